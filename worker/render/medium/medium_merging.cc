// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Heterogeneous media that overlap become one. A medium may be merged if one surface alone names
// it, an interface with no medium in front, and this surface is closed and leaves nothing of the
// density outside: then any larger surface bounds the same medium. Groups of such media whose
// surfaces' boxes overlap get one box, and one MergedMedium. See docs/adr/0310.
#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <span>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "common/scene/half_space.h"
#include "worker/render/geometry/bounds.h"
#include "worker/render/medium/medium.h"

namespace sheaf::render {

// A medium that may be merged.
struct MediumTable::MergeInput {
  int32_t medium = kNone;  // In the scene.
  size_t mesh = 0;         // Its surface, in groups[0].
  Bounds box;              // The box of the surface.
};

namespace {

// The media of a group must fill the box around them this many times on average: fewer walks pay
// for coarser cells. Measured by tests/bench/overlapping_volumes.py.
constexpr double kFillMin = 1.5;
// The part of its size by which a surface may cut into a density that is meant to end there: the
// rounding of its vertices. The merged box is as much larger than what it contains.
constexpr double kRounding = 0x1p-17;
constexpr double kExtinctionMin = 1e-20;

double VolumeOf(const Bounds& box) {
  const Vec3d size = box.upper() - box.lower();
  return size.x * size.y * size.z;
}
double DiagonalOf(const Bounds& box) { return Length(box.upper() - box.lower()); }

// Whether the boxes share more than faces.
bool Overlap(const Bounds& a, const Bounds& b) {
  for (size_t i = 0; i < 3; ++i) {
    if (!(a.lower()[i] < b.upper()[i] && b.lower()[i] < a.upper()[i])) return false;
  }
  return true;
}
bool Holds(const Bounds& a, const Bounds& b) {
  for (size_t i = 0; i < 3; ++i) {
    if (!(a.lower()[i] < b.lower()[i] && b.upper()[i] < a.upper()[i])) return false;
  }
  return true;
}

// The number of surfaces that name each medium on a side.
std::vector<uint32_t> CountNames(const SceneDescription& scene, const SceneGeometry& geometry) {
  std::vector<uint32_t> names(scene.media.size(), 0);
  const auto add = [&](const Surface& surface) {
    for (const int32_t medium : {surface.media.inside, surface.media.outside}) {
      if (medium != kNone) ++names[static_cast<size_t>(medium)];
    }
  };
  for (const GeometryGroup& group : geometry.groups) {
    for (const BakedMesh& mesh : group.meshes) add(mesh.surface);
    for (const BakedQuadric& quadric : group.quadrics) add(quadric.surface);
    for (const BakedPatches& patches : group.patches) add(patches.surface);
    for (const BakedCurves& curves : group.curves) add(curves.surface);
  }
  return names;
}

bool IsPlainInterface(const SceneDescription& scene, const BakedMesh& mesh) {
  const Surface& surface = mesh.surface;
  if (surface.material == kNone || surface.has_alpha || surface.emitter != kNoEmitter) return false;
  if (surface.invisible != 0) return false;
  const MaterialDescription& material = scene.materials[static_cast<size_t>(surface.material)];
  return std::holds_alternative<InterfaceMaterial>(material.material) && !material.priority &&
         surface.media.inside != kNone && surface.media.outside == kNone && mesh.steps.empty();
}

// Whether the closed mesh contains the points, which are corners of a box: they lie behind all
// planes of its triangles.
bool Contains(const BakedMesh& mesh, const std::vector<Vec3d>& points, double tolerance) {
  if (EnclosedSideOf(mesh.positions, mesh.indices) == EnclosedSide::kNeither) return false;
  for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const uint32_t* t = &mesh.indices[i];
    const Vec3d p = ToDouble(mesh.positions[t[0]]);
    const Vec3d cross =
        Cross(ToDouble(mesh.positions[t[1]]) - p, ToDouble(mesh.positions[t[2]]) - p);
    const Vec3d outward = Normalize(cross) * static_cast<double>(TriangleFacing(mesh, t, cross));
    for (const Vec3d& point : points) {
      if (!(Dot(outward, point - p) <= tolerance)) return false;
    }
  }
  return true;
}

void AddCorners(const HeterogeneousMedium& density, std::vector<Vec3d>* corners) {
  const IndexBox& box = density.majorants().box();
  if (!(box.lo.x < box.hi.x)) return;
  for (int n = 0; n < 8; ++n) {
    corners->push_back(density.render_from_index().Point({(n & 1) != 0 ? box.hi.x : box.lo.x,
                                                          (n & 2) != 0 ? box.hi.y : box.lo.y,
                                                          (n & 4) != 0 ? box.hi.z : box.lo.z}));
  }
}

// Makes the mesh a box that faces outward.
void BecomeBox(const Bounds& box, BakedMesh* mesh) {
  mesh->positions.clear();
  for (int n = 0; n < 8; ++n) {
    const auto side = [&](size_t a) {
      return static_cast<float>((n >> a & 1) != 0 ? box.upper()[a] : box.lower()[a]);
    };
    mesh->positions.push_back({side(0), side(1), side(2)});
  }
  mesh->positions.push_back({});
  mesh->indices = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                   2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
  mesh->normals.clear();
  mesh->uvs.clear();
  mesh->tangents.clear();
  mesh->colors.clear();
  mesh->surface.flips_normal = false;
  mesh->target_from_shape = mesh->shape_from_target = {};
}

}  // namespace

std::vector<MediumTable::MergeInput> MediumTable::MergeInputs(const SceneDescription& scene,
                                                              const SceneGeometry& geometry) const {
  const std::vector<uint32_t> names = CountNames(scene, geometry);
  const std::vector<BakedMesh>& meshes = geometry.groups[0].meshes;
  std::vector<MergeInput> inputs;
  for (size_t i = 0; i < meshes.size(); ++i) {
    if (!IsPlainInterface(scene, meshes[i])) continue;
    const int32_t medium = meshes[i].surface.media.inside;
    const Medium& its = media_[IndexOf(medium)];
    if (!its.is_heterogeneous || names[static_cast<size_t>(medium)] != 1) continue;
    std::vector<Vec3d> corners;
    bool moves = false;
    for (const Part& part : its.parts) {
      moves |= part.density.moves();
      AddCorners(part.density, &corners);
    }
    MergeInput input{medium, i, {}};
    for (const uint32_t v : meshes[i].indices) input.box.Add(ToDouble(meshes[i].positions[v]));
    if (!moves && Contains(meshes[i], corners, kRounding * DiagonalOf(input.box))) {
      inputs.push_back(input);
    }
  }
  return inputs;
}

bool MediumTable::Merge(std::span<const MergeInput> inputs, int32_t camera_medium,
                        const Bounds& camera_origins, int thread_count, SceneGeometry* geometry) {
  Bounds box;
  bool camera_is_within = false, camera_is_named = false, camera_is_beside = true;
  for (const MergeInput& input : inputs) {
    box.Add(input.box.lower());
    box.Add(input.box.upper());
    camera_is_within |= Holds(input.box, camera_origins);
    camera_is_beside &= !Overlap(input.box, camera_origins);
    camera_is_named |= input.medium == camera_medium;
  }
  const double margin = kRounding * DiagonalOf(box);
  box.Add(box.lower() - Vec3d{margin, margin, margin});
  box.Add(box.upper() + Vec3d{margin, margin, margin});
  // The scene must say of the camera what is true of its place.
  const bool is_inside = Holds(box, camera_origins);
  if (!is_inside && Overlap(box, camera_origins)) return false;
  if (camera_is_named ? !camera_is_within
                      : !camera_is_beside || (is_inside && camera_medium != kNone))
    return false;

  Medium medium;
  std::vector<MergedMedium::Member> members;
  for (const MergeInput& input : inputs) {
    const uint16_t index = IndexOf(input.medium);
    medium.members.push_back(index);
    medium.has_emissive_grid |= media_[index].has_emissive_grid;
    for (uint16_t part = 0; part < media_[index].parts.size(); ++part) {
      const auto its = CoefficientsOf<Rgb>({index, part}, NoWavelengths{}, MediumForm::kTrue);
      // A spectrum may be above 0 where its color is 0.
      const double extinction = std::max(kExtinctionMin, double{MaxComponent(its.sigma_t)});
      members.push_back({&DensityOf({index, part}), extinction, index, part});
    }
  }
  medium.is_heterogeneous = medium.is_bounded = true;
  medium.merged = std::make_unique<const MergedMedium>(std::move(members), box, thread_count);
  const auto merged = static_cast<uint16_t>(media_.size());
  for (const MergeInput& input : inputs) {
    index_of_[static_cast<size_t>(input.medium)] = merged;
    geometry->groups[0].meshes[input.mesh].indices.clear();  // Others keep their places.
  }
  BecomeBox(box, &geometry->groups[0].meshes[inputs[0].mesh]);
  media_.push_back(std::move(medium));
  if (is_inside) {
    camera_media_ = {};
    std::ignore = camera_media_.Add(merged);
  }
  return true;
}

void MediumTable::MergeOverlapping(const SceneDescription& scene, const Bounds& camera_origins,
                                   int thread_count, SceneGeometry* geometry) {
  std::vector<MergeInput> inputs = MergeInputs(scene, *geometry);
  // Connected groups: each input's group has the number of its first input.
  std::vector<size_t> group(inputs.size());
  std::iota(group.begin(), group.end(), size_t{0});
  for (size_t i = 0; i < inputs.size(); ++i) {
    for (size_t k = 0; k < i; ++k) {
      if (group[i] == group[k] || !Overlap(inputs[i].box, inputs[k].box)) continue;
      const auto [to, from] = std::minmax(group[i], group[k]);
      std::replace(group.begin(), group.end(), size_t{from}, size_t{to});
    }
  }
  for (size_t first = 0; first < inputs.size(); ++first) {
    std::vector<MergeInput> together;
    for (size_t i = first; i < inputs.size(); ++i) {
      if (group[i] == first) together.push_back(inputs[i]);
    }
    // Neighbors come first into the same of several media.
    std::stable_sort(together.begin(), together.end(), [](const auto& a, const auto& b) {
      return a.box.lower().x < b.box.lower().x;
    });
    while (together.size() > 1 && media_.size() < kMediaMax) {
      Bounds box;
      double volume = 0;
      size_t count = 0, parts = 0;
      for (; count < together.size(); ++count) {
        parts += media_[IndexOf(together[count].medium)].parts.size();
        if (parts > kMergedMembersMax) break;
        box.Add(together[count].box.lower());
        box.Add(together[count].box.upper());
        volume += VolumeOf(together[count].box);
      }
      if (count > 1 && volume >= kFillMin * VolumeOf(box)) {
        Merge(std::span(together).first(count), scene.camera.medium, camera_origins, thread_count,
              geometry);
      }
      together.erase(together.begin(), together.begin() + static_cast<ptrdiff_t>(count));
    }
  }
}

size_t MediumTable::merged_count() const {
  size_t count = 0;
  for (const Medium& medium : media_) count += medium.merged ? medium.members.size() : 0;
  return count;
}

}  // namespace sheaf::render
