// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Places and checks meshes, patches, curves and quadrics, with one rounding to float.
#include "worker/render/scene/shape_baker.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <utility>
#include <variant>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "worker/render/geometry/plain_shape.h"

namespace sheaf::render {
namespace {

// Steps along each parameter of an emissive quadric that is sampled as triangles: its area
// decreases by a relative (2 pi / steps)^2 / 6 = 4e-4, its silhouette by less.
constexpr uint32_t kEmissiveQuadricSteps = 128;
constexpr char kTooFar[] =
    "Shape: it reaches farther than 1e18 from the camera, or from the middle of its object, which "
    "rays cannot trace; scale the scene down";

// None for meshes.
std::optional<Quadric> QuadricOf(const ShapeDescription& shape) {
  if (const auto* sphere = std::get_if<SphereShape>(&shape.shape)) return MakeQuadric(*sphere);
  if (const auto* disk = std::get_if<DiskShape>(&shape.shape)) return MakeQuadric(*disk);
  if (const auto* cylinder = std::get_if<CylinderShape>(&shape.shape)) {
    return MakeQuadric(*cylinder);
  }
  return std::nullopt;
}

bool HasExtent(const Quadric& q) {
  return q.radius > 0 && q.phi_max > 0 && q.inner_radius < q.radius &&
         (q.kind == Quadric::Kind::kDisk || q.z_min < q.z_max);
}

// Transforms positions and normals. Returns false if a position is farther than kTracedMax.
bool PlaceVertices(const Affine& target_from_shape, bool reverse_orientation,
                   std::vector<Vec3f>* positions, std::vector<Vec3f>* normals) {
  for (Vec3f& p : *positions) {
    p = ToFloat(target_from_shape.Point(ToDouble(p)));
    if (!IsTraced(p)) return false;
  }
  const Affine shape_from_target = Inverse(target_from_shape);
  for (Vec3f& n : *normals) {
    const Vec3d turned = shape_from_target.TransposedVector(ToDouble(n));
    const double length = Length(turned);
    const double scale = (reverse_orientation ? -1 : 1) / length;
    n = length > 0 && std::isfinite(length) ? ToFloat(turned * scale) : Vec3f{};
  }
  return true;
}

// Moves a mesh of triangles or patches to the space where it is traced. Returns false if that
// is farther than kTracedMax.
template <typename Mesh, typename Baked>
bool Place(const ShapeDescription& shape, const Surface& surface, const Affine& target_from_shape,
           Mesh* mesh, Baked* baked) {
  baked->surface = surface;
  baked->surface.flips_normal ^= target_from_shape.Determinant() < 0;
  baked->target_from_shape = target_from_shape;
  baked->shape_from_target = Inverse(target_from_shape);
  baked->positions = std::move(mesh->positions);
  baked->normals = std::move(mesh->normals);
  baked->uvs = std::move(mesh->uvs);
  baked->indices = std::move(mesh->indices);
  return PlaceVertices(target_from_shape, shape.reverse_orientation, &baked->positions,
                       &baked->normals);
}

float AreaOf(const BakedMesh& mesh) {
  double twice = 0;
  for (size_t i = 0; i + 2 < mesh.indices.size(); i += 3) {
    const Vec3d p = ToDouble(mesh.positions[mesh.indices[i]]);
    twice += Length(Cross(ToDouble(mesh.positions[mesh.indices[i + 1]]) - p,
                          ToDouble(mesh.positions[mesh.indices[i + 2]]) - p));
  }
  return static_cast<float>(twice / 2);
}
float AreaOf(const BakedPatches& patches) {
  double sum = 0;
  for (size_t i = 0; i < patches.size(); ++i) sum += Length(patches.PatchAt(i).NormalAt(0.5, 0.5));
  return static_cast<float>(sum);
}
float AreaOf(const Quadric& q) {
  const double scale = std::cbrt(std::fabs(q.target_from_object.Determinant()));
  double flat = 0;  // In object space.
  switch (q.kind) {
    case Quadric::Kind::kDisk:
      flat = (q.radius - q.inner_radius) * (q.radius + q.inner_radius) / 2;
      return static_cast<float>(q.phi_max * flat *
                                Length(Cross(q.target_from_object.x, q.target_from_object.y)));
    case Quadric::Kind::kSphere:  // Archimedes: as that of the cylinder about it.
    case Quadric::Kind::kCylinder:
      flat = q.radius * (q.z_max - q.z_min);
  }
  return static_cast<float>(q.phi_max * flat * scale * scale);
}

// Bounds the terms of the sums that place a curve's points, which may cancel.
void GrowCoordinateMax(const CurveSegment& segment, const Affine& transform, Vec3f* max) {
  const double reach = std::max(segment.widths[0], segment.widths[1]);
  for (const Vec3d& p : segment.points) {
    for (size_t k = 0; k < 3; ++k) {
      const double sum = (std::fabs(p.x) + reach) * std::fabs(transform.x[k]) +
                         (std::fabs(p.y) + reach) * std::fabs(transform.y[k]) +
                         (std::fabs(p.z) + reach) * std::fabs(transform.z[k]) +
                         std::fabs(transform.offset[k]);
      (*max)[k] = std::fmax((*max)[k], static_cast<float>(sum));
    }
  }
}

// Keeps the faces that have_area selects, of `corners` indices each; returns the number dropped.
template <typename HasArea>
size_t DropFaces(size_t corners, HasArea has_area, std::vector<uint32_t>* indices) {
  size_t kept = 0, dropped = 0;
  for (size_t i = 0; i + corners <= indices->size(); i += corners) {
    if (!has_area(&(*indices)[i])) {
      ++dropped;
      continue;
    }
    for (size_t k = 0; k < corners; ++k) (*indices)[kept + k] = (*indices)[i + k];
    kept += corners;
  }
  indices->resize(kept);
  return dropped;
}

}  // namespace

ShapeBaker::ShapeBaker(SceneDescription* scene, EmissionMaps maps)
    : scene_(*scene),
      needs_(*scene),
      emitters_(*scene, std::move(maps)),
      mesh_uses_(scene->meshes.size(), 0) {
  const auto count = [this](int32_t shape) {
    const auto* mesh = std::get_if<MeshShape>(&scene_.shapes[shape].shape);
    if (mesh != nullptr) ++mesh_uses_[mesh->mesh];
  };
  for (const int32_t shape : scene_.world_shapes) count(shape);
  for (const ObjectDefinition& object : scene_.objects) {
    for (const int32_t shape : object.shapes) count(shape);
  }
}

absl::Status ShapeBaker::Fail(const ShapeDescription& shape, const std::string& what) const {
  return absl::InvalidArgumentError(
      absl::StrCat(FormatLocation(scene_, shape.location), ": ", what));
}

TriangleMesh ShapeBaker::TakeMesh(int32_t mesh) {
  if (--mesh_uses_[mesh] == 0) return std::move(scene_.meshes[mesh]);
  return scene_.meshes[mesh];
}

Surface ShapeBaker::MakeSurface(int32_t shape_index) const {
  const ShapeDescription& shape = scene_.shapes[shape_index];
  const MaterialNeeds& needs = needs_.Of(shape.material);
  Surface surface;
  surface.material = shape.material;
  surface.shape = shape_index;
  surface.flips_normal = shape.reverse_orientation;
  surface.has_alpha = shape.has_alpha;
  if (shape.media.Separates()) surface.media = shape.media;
  surface.encloses_subsurface = Has(needs.traits, Trait::kSubsurface);
  surface.has_subsurface_texture = needs.has_subsurface_texture;
  surface.may_pass = needs.may_pass;
  surface.is_boundary = needs.is_boundary || shape.media.Separates();
  surface.invisible = shape.invisible;
  const bool has_priority = shape.material != kNone && scene_.materials[shape.material].priority;
  surface.seen_by =
      SeenBy(shape.invisible, shape.area_light != kNone,
             shape.media.Separates() || has_priority || Has(needs.traits, Trait::kSubsurface));
  surface.emits_on_front_only =
      shape.area_light != kNone &&
      !scene_.area_lights[static_cast<size_t>(shape.area_light)].two_sided;
  surface.is_sphere = std::holds_alternative<SphereShape>(shape.shape);
  surface.needs_tangent = needs.anisotropic || needs.has_normal_map;
  surface.has_normal_map = needs.has_normal_map;
  surface.reads_textures =
      needs.reads_textures || (shape.has_alpha && shape.alpha.texture != kNone) ||
      (shape.area_light != kNone && !scene_.area_lights[shape.area_light].file.empty());
  return surface;
}

absl::Status ShapeBaker::AddMesh(const ShapeDescription& shape, Surface surface, TriangleMesh mesh,
                                 const Affine& target_from_shape, GeometryGroup* group) {
  BakedMesh baked;
  if (!Place(shape, surface, target_from_shape, &mesh, &baked)) return Fail(shape, kTooFar);
  baked.positions.push_back({});
  if (surface.needs_tangent) {
    baked.tangents = std::move(mesh.tangents);
    for (Vec3f& t : baked.tangents) t = ToFloat(target_from_shape.Vector(ToDouble(t)));
  }
  if (surface.reads_textures) baked.colors = std::move(mesh.colors);
  if (scene_.camera.shutter_close > scene_.camera.shutter_open) {
    baked.steps = std::move(mesh.steps);
  }
  for (VertexStep& step : baked.steps) {
    if (!PlaceVertices(target_from_shape, shape.reverse_orientation, &step.positions,
                       &step.normals)) {
      return Fail(shape, kTooFar);
    }
    step.positions.push_back({});
  }
  if (!baked.steps.empty() && shape.area_light != kNone) {
    return Fail(shape,
                "Shape: a mesh that deforms cannot be an area light; give it one set of "
                "vertices");
  }
  // Triangles without area can neither be hit nor emit, and only disturb the tracer.
  const auto has_area_at = [](const std::vector<Vec3f>& positions, const uint32_t* t) {
    const Vec3d p0 = ToDouble(positions[t[0]]);
    const Vec3d area = Cross(ToDouble(positions[t[1]]) - p0, ToDouble(positions[t[2]]) - p0);
    return LengthSquared(area) > 0;
  };
  const auto has_area = [&](const uint32_t* t) {
    return has_area_at(baked.positions, t) ||
           std::any_of(baked.steps.begin(), baked.steps.end(),
                       [&](const VertexStep& step) { return has_area_at(step.positions, t); });
  };
  degenerate_triangle_count_ += DropFaces(3, has_area, &baked.indices);
  if (baked.indices.empty()) return absl::OkStatus();
  baked.surface.area = AreaOf(baked);
  if (shape.area_light != kNone) {
    baked.surface.emitter = emitters_.AddMesh(shape.area_light, &baked);
  }
  group->meshes.push_back(std::move(baked));
  return absl::OkStatus();
}

absl::Status ShapeBaker::AddPatches(const ShapeDescription& shape, Surface surface,
                                    const Affine& target_from_shape, GeometryGroup* group) {
  const bool is_light = shape.area_light != kNone;
  BilinearMesh mesh =
      std::move(scene_.bilinear_meshes[std::get<BilinearMeshShape>(shape.shape).mesh]);
  if (IsTriangles(mesh, is_light)) {
    return AddMesh(shape, surface, ToTriangles(mesh), target_from_shape, group);
  }
  if (is_light) {
    return Fail(shape,
                "Shape \"bilinearmesh\": as an area light its patches must be parallelograms, with "
                "one normal each and linear uvs if any; use a triangle mesh for other shapes");
  }
  BakedPatches baked;
  if (!Place(shape, surface, target_from_shape, &mesh, &baked)) return Fail(shape, kTooFar);
  const auto has_area = [&](const uint32_t* k) {
    const auto corner = [&](size_t c) { return ToDouble(baked.positions[k[c]]); };
    const BilinearPatch patch{corner(0), corner(1), corner(2), corner(3)};
    return LengthSquared(patch.NormalAt(0.5, 0.5)) > 0;
  };
  degenerate_triangle_count_ += 2 * DropFaces(4, has_area, &baked.indices);
  baked.surface.area = AreaOf(baked);
  if (!baked.indices.empty()) group->patches.push_back(std::move(baked));
  return absl::OkStatus();
}

absl::Status ShapeBaker::AddCurves(const ShapeDescription& shape, Surface surface,
                                   const Affine& target_from_shape, GeometryGroup* group) {
  if (shape.area_light != kNone) {
    return Fail(shape, "Shape \"curve\": curves cannot be area lights; use spheres or a mesh");
  }
  BakedCurves baked;
  surface.needs_tangent = true;  // Shading depends on the fiber's direction.
  baked.surface = surface;
  baked.set = std::move(scene_.curve_sets[std::get<CurveShape>(shape.shape).curves]);
  baked.target_from_shape = target_from_shape;
  baked.shape_from_target = Inverse(target_from_shape);
  SortCurves(&baked.set);
  for (uint32_t i = 0; i < baked.set.size(); ++i) {
    const CurveSegment segment = SegmentOf(baked.set, i);
    const Vec3d first = segment.points[0];
    const bool has_length = std::any_of(segment.points.begin() + 1, segment.points.end(),
                                        [first](const Vec3d& p) { return !(p == first); });
    if (!has_length || !(segment.widths[0] > 0 || segment.widths[1] > 0)) continue;
    SplitCurve(segment, i, target_from_shape, &baked.pieces);
    for (const Vec3f& p : CurveBounds(segment, {i, 0, 1}, target_from_shape)) {
      if (!IsTraced(p)) return Fail(shape, kTooFar);
    }
    GrowCoordinateMax(segment, target_from_shape, &baked.coordinate_max);
  }
  if (!baked.pieces.empty()) {
    baked.pieces.shrink_to_fit();
    baked.rods.reserve(baked.pieces.size());
    for (const CurvePiece& piece : baked.pieces) {
      baked.rods.push_back(RodAbout(SegmentOf(baked.set, piece.segment), piece, target_from_shape));
    }
    group->curves.push_back(std::move(baked));
  }
  return absl::OkStatus();
}

absl::Status ShapeBaker::AddQuadric(const ShapeDescription& shape, Surface surface, Quadric q,
                                    const Affine& target_from_shape, GeometryGroup* group) {
  if (!HasExtent(q)) {
    return Fail(shape,
                "Shape: a sphere, cylinder or disk without extent; give it a positive radius, "
                "phimax and z range");
  }
  q.target_from_object = target_from_shape;
  q.object_from_target = Inverse(target_from_shape);
  const std::array<Vec3f, 2> bounds = QuadricBounds(q);
  q.coordinate_max = QuadricCoordinateMax(q, bounds);
  if (!IsTraced(bounds[0]) || !IsTraced(bounds[1]) || !IsTraced(q.coordinate_max)) {
    return Fail(shape, kTooFar);
  }
  if (shape.area_light != kNone && !EmitterList::IsSampled(q)) {
    LogWarning(absl::StrCat(FormatLocation(scene_, shape.location),
                            ": Shape: as an area light of this form it is ",
                            2 * kEmissiveQuadricSteps * kEmissiveQuadricSteps, " triangles"));
    surface.is_sphere = false;
    const uint64_t degenerate = degenerate_triangle_count_;
    const absl::Status status = AddMesh(shape, surface, *TrianglesOf(shape, kEmissiveQuadricSteps),
                                        target_from_shape, group);
    degenerate_triangle_count_ = degenerate;  // Those at the poles are not the scene's fault.
    return status;
  }
  surface.area = AreaOf(q);
  if (shape.area_light != kNone) {
    surface.emitter = emitters_.AddQuadric(q, surface, shape.area_light);
  }
  group->quadrics.push_back({surface, q});
  return absl::OkStatus();
}

absl::Status ShapeBaker::AddShape(int32_t shape_index, const Affine& target_from_shape,
                                  bool may_emit, GeometryGroup* group) {
  const ShapeDescription& shape = scene_.shapes[shape_index];
  if (shape.area_light != kNone && !may_emit) {
    return Fail(shape,
                "Shape: area lights that move or belong to an object definition are not supported; "
                "place the emissive shape in the world, at rest");
  }
  const Surface surface = MakeSurface(shape_index);
  if (const auto* mesh = std::get_if<MeshShape>(&shape.shape)) {
    return AddMesh(shape, surface, TakeMesh(mesh->mesh), target_from_shape, group);
  }
  if (std::holds_alternative<CurveShape>(shape.shape)) {
    return AddCurves(shape, surface, target_from_shape, group);
  }
  const std::optional<Quadric> quadric = QuadricOf(shape);
  return quadric.has_value() ? AddQuadric(shape, surface, *quadric, target_from_shape, group)
                             : AddPatches(shape, surface, target_from_shape, group);
}

void ShapeBaker::GrowBounds(const ShapeDescription& shape, const Affine& transform,
                            Bounds* bounds) const {
  if (std::optional<Quadric> q = QuadricOf(shape)) {
    q->target_from_object = transform;
    for (const Vec3f& p : QuadricBounds(*q)) bounds->Add(ToDouble(p));
    return;
  }
  if (const auto* curves = std::get_if<CurveShape>(&shape.shape)) {
    const CurveSet& set = scene_.curve_sets[curves->curves];
    for (size_t i = 0; i < set.size(); ++i) {
      for (const Vec3f& p : CurveBounds(SegmentOf(set, i), {}, transform)) {
        bounds->Add(ToDouble(p));
      }
    }
    return;
  }
  const auto add = [&](const std::vector<Vec3f>& positions) {
    for (const Vec3f& p : positions) bounds->Add(transform.Point(ToDouble(p)));
  };
  if (const auto* shape_mesh = std::get_if<MeshShape>(&shape.shape)) {
    const TriangleMesh& mesh = scene_.meshes[shape_mesh->mesh];
    add(mesh.positions);
    for (const VertexStep& step : mesh.steps) add(step.positions);
    return;
  }
  add(scene_.bilinear_meshes[std::get<BilinearMeshShape>(shape.shape).mesh].positions);
}

LightTableInput ShapeBaker::TakeEmitters(GeometryGroup* world) {
  emitters_.AssignIds(world);
  return emitters_.Take();
}

}  // namespace sheaf::render
