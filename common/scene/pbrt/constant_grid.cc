// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/pbrt/constant_grid.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/scene/enclosed_side.h"
#include "common/scene/pbrt/statements/color_parameters.h"

namespace sheaf {
namespace {

template <typename Value>
bool IsConstant(const std::vector<Value>& cells) {
  return std::all_of(cells.begin(), cells.end(),
                     [&](const Value& cell) { return cell == cells[0]; });
}

// Values are exactly those of the cells between the centers of the outermost cells. This region is
// extended by this many cells, where a density is lower by this fraction of itself: geometry that
// touches the centers may cross them by rounding.
constexpr double kSlackCells = 1e-6;
struct Reach {
  Vec3d lower{0, 0, 0}, upper{0, 0, 0};
  bool Contains(Vec3d p, Vec3d radius = {0, 0, 0}) const {
    for (size_t i = 0; i < 3; ++i) {
      if (!(p[i] - radius[i] >= lower[i] && p[i] + radius[i] <= upper[i])) return false;
    }
    return true;
  }
};
Reach ReachOf(const GridBox& box) {
  Reach reach{box.p0, box.p1};
  for (size_t i = 0; i < 3; ++i) {
    const double rim = (0.5 - kSlackCells) * (box.p1[i] - box.p0[i]) / box.counts[i];
    reach.lower[i] += rim;
    reach.upper[i] -= rim;
  }
  return reach;
}

// A grid of one value, and its values as a homogeneous medium.
struct Candidate {
  size_t medium = 0;
  Reach reach;
  ColorSpec sigma_a, sigma_s;
  float scale = 1, radiance_scale = 1;
};

bool FindCandidate(const MediumDescription& medium, Candidate* candidate) {
  candidate->sigma_a = medium.sigma_a;
  candidate->sigma_s = medium.sigma_s;
  candidate->scale = medium.scale;
  candidate->radiance_scale = medium.radiance_scale;
  if (const auto* grid = std::get_if<UniformGridMedium>(&medium.kind)) {
    // Media that emit by temperature have no radiance of their own.
    if (grid->density.empty() || !IsConstant(grid->density) || !grid->temperature_k.empty() ||
        !IsConstant(grid->radiance_scale)) {
      return false;
    }
    candidate->reach = ReachOf(grid->box);
    candidate->scale *= grid->density[0];
    if (!grid->radiance_scale.empty()) candidate->radiance_scale *= grid->radiance_scale[0];
    return std::isfinite(candidate->scale) && std::isfinite(candidate->radiance_scale);
  }
  const auto* grid = std::get_if<RgbGridMedium>(&medium.kind);
  if (grid == nullptr || medium.emits || !IsConstant(grid->sigma_a) || !IsConstant(grid->sigma_s)) {
    return false;
  }
  candidate->reach = ReachOf(grid->box);
  // Without cells, sigma_a and sigma_s are 1, like those of such a medium.
  if (!grid->sigma_a.empty()) candidate->sigma_a = RgbColor(grid->sigma_a[0]);
  if (!grid->sigma_s.empty()) candidate->sigma_s = RgbColor(grid->sigma_s[0]);
  return true;
}

// Whether the mesh encloses its inside, the space behind its front. If the mesh has normals, they
// define the front, and must do so clearly.
bool EnclosesInside(const TriangleMesh& mesh, const ShapeDescription& shape,
                    const Matrix4& shape_from_world) {
  const EnclosedSide side = EnclosedSideOf(mesh.positions, mesh.indices);
  if (side == EnclosedSide::kNeither) return false;
  if (mesh.normals.empty()) return (side == EnclosedSide::kBack) != shape.reverse_orientation;
  constexpr double kClearly = 1e-3;  // Cosine.
  const double front = (side == EnclosedSide::kBack) != shape.reverse_orientation ? 1 : -1;
  for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const uint32_t* t = &mesh.indices[i];
    const Vec3d p = ToDouble(mesh.positions[t[0]]);
    const Vec3d cross = TransformNormal(
        shape_from_world,
        Cross(ToDouble(mesh.positions[t[1]]) - p, ToDouble(mesh.positions[t[2]]) - p));
    for (size_t k = 0; k < 3; ++k) {
      const Vec3d n = TransformNormal(shape_from_world, ToDouble(mesh.normals[t[k]]));
      if (!(front * Dot(cross, n) >= kClearly * Length(cross) * Length(n))) return false;
    }
  }
  return true;
}

// Why a medium inside the placed shape differs from a homogeneous one; empty if it does not.
std::string ObstacleAt(const SceneDescription& scene, const ShapeDescription& shape,
                       const Matrix4& world_from_shape, const Matrix4& medium_from_world,
                       const Reach& reach) {
  constexpr char kReachesOut[] =
      " reaches beyond the outermost values of the grid, where densities fall to 0";
  constexpr char kIsOpen[] = " is not known to enclose it";
  const Matrix4 medium_from_shape = medium_from_world * world_from_shape;
  if (const auto* sphere = std::get_if<SphereShape>(&shape.shape)) {
    if (sphere->phi_max_degrees < 360 || std::min(sphere->z_min, sphere->z_max) > -sphere->radius ||
        std::max(sphere->z_min, sphere->z_max) < sphere->radius || shape.reverse_orientation ||
        Determinant3(world_from_shape) < 0) {
      return kIsOpen;
    }
    Vec3d radius{0, 0, 0};
    for (size_t i = 0; i < 3; ++i) {
      const auto& row = medium_from_shape.m[i];
      radius[i] = static_cast<double>(sphere->radius) * Length(Vec3d{row[0], row[1], row[2]});
    }
    return reach.Contains(TransformPoint(medium_from_shape, {0, 0, 0}), radius) ? "" : kReachesOut;
  }
  const auto* shape_mesh = std::get_if<MeshShape>(&shape.shape);
  Matrix4 shape_from_world;
  if (shape_mesh == nullptr || !Invert(world_from_shape, &shape_from_world)) return kIsOpen;
  const TriangleMesh& mesh = scene.meshes[static_cast<size_t>(shape_mesh->mesh)];
  if (shape_mesh->IsDisplaced()) return " is displaced";
  if (!mesh.steps.empty()) return " deforms";
  for (const uint32_t index : mesh.indices) {
    const Vec3d p = TransformPoint(medium_from_shape, ToDouble(mesh.positions[index]));
    if (!reach.Contains(p)) return kReachesOut;
  }
  return EnclosesInside(mesh, shape, shape_from_world) ? "" : kIsOpen;
}

// A shape that bounds media, placed in the world.
struct Placed {
  const ShapeDescription* shape;
  Matrix4 world_from_shape;
  bool moves;
};
std::vector<Placed> Boundaries(const SceneDescription& scene) {
  std::vector<Placed> placed;
  const auto shape_at = [&](int32_t index) { return &scene.shapes[static_cast<size_t>(index)]; };
  for (const int32_t index : scene.world_shapes) {
    const ShapeDescription* shape = shape_at(index);
    if (!shape->media.Separates()) continue;
    placed.push_back(
        {shape, shape->world_from_object.start, shape->world_from_object.IsAnimated()});
  }
  for (const ObjectInstance& instance : scene.instances) {
    for (const int32_t index : scene.objects[static_cast<size_t>(instance.object)].shapes) {
      const ShapeDescription* shape = shape_at(index);
      if (!shape->media.Separates()) continue;
      placed.push_back(
          {shape, instance.world_from_instance.start * shape->world_from_object.start,
           instance.world_from_instance.IsAnimated() || shape->world_from_object.IsAnimated()});
    }
  }
  return placed;
}

// Why the candidate stays a grid; empty if it need not.
std::string ObstacleTo(const Candidate& candidate, const SceneDescription& scene,
                       const std::vector<Placed>& boundaries) {
  const MediumDescription& medium = scene.media[candidate.medium];
  const auto index = static_cast<int32_t>(candidate.medium);
  if (scene.camera.medium == index) return "the camera is in it";
  // Moving values may bring in the 0 from beyond the grid.
  if (medium.Moves()) return "it moves by velocities";
  Matrix4 medium_from_world;
  if (!Invert(medium.world_from_medium, &medium_from_world)) return "its transform is singular";
  bool is_bounded = false;
  for (const Placed& placed : boundaries) {
    const ShapeDescription& shape = *placed.shape;
    const std::string where = absl::StrCat("the shape at ", FormatLocation(scene, shape.location));
    if (shape.media.outside == index) return absl::StrCat(where, " has it outside");
    if (shape.media.inside != index) continue;
    is_bounded = true;
    if (placed.moves) return absl::StrCat(where, " moves");
    const std::string obstacle =
        ObstacleAt(scene, shape, placed.world_from_shape, medium_from_world, candidate.reach);
    if (!obstacle.empty()) return absl::StrCat(where, obstacle);
  }
  return is_bounded ? "" : "no shape has it inside";
}

}  // namespace

void ConvertConstantGrids(SceneDescription* scene) {
  std::vector<Candidate> candidates;
  for (size_t i = 0; i < scene->media.size(); ++i) {
    Candidate candidate;
    candidate.medium = i;
    if (FindCandidate(scene->media[i], &candidate)) candidates.push_back(std::move(candidate));
  }
  if (candidates.empty()) return;
  const std::vector<Placed> boundaries = Boundaries(*scene);
  for (Candidate& candidate : candidates) {
    const std::string obstacle = ObstacleTo(candidate, *scene, boundaries);
    MediumDescription& medium = scene->media[candidate.medium];
    if (!obstacle.empty()) {
      medium.constant_grid = absl::StrCat("constant grid: stays a grid, because ", obstacle);
      continue;
    }
    medium.constant_grid = "constant grid: treated as homogeneous";
    medium.kind = HomogeneousMedium{};
    medium.sigma_a = std::move(candidate.sigma_a);
    medium.sigma_s = std::move(candidate.sigma_s);
    medium.scale = candidate.scale;
    medium.radiance_scale = candidate.radiance_scale;
  }
}

}  // namespace sheaf
