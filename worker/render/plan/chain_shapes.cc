// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/plan/chain_shapes.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <variant>

#include "absl/strings/str_cat.h"
#include "worker/render/geometry/affine.h"
#include "worker/render/geometry/bilinear_patch.h"
#include "worker/render/plan/vertex_normals.h"

namespace sheaf::render {
namespace {

// A lamp is small where its radius is at most this part of that of the largest caster: larger ones
// are found by scattering often enough.
constexpr double kLampRadiusMax = 0.25;
// Each vertex looks at all casters.
constexpr size_t kCastersMax = 64;
// Named in a note; the others are counted.
constexpr size_t kNamedMax = 3;

bool IsZero(const FloatInput& input) { return input.texture == kNone && input.value == 0; }
bool IsSmooth(const RoughnessInput& roughness) {
  return IsZero(roughness.u) && IsZero(roughness.v);
}

bool IsSmoothInterface(const MaterialDescription& description) {
  if (const auto* dielectric = std::get_if<DielectricMaterial>(&description.material)) {
    return IsSmooth(dielectric->roughness) && !dielectric->eta.IsMatched();
  }
  const auto* conductor = std::get_if<ConductorMaterial>(&description.material);
  return conductor != nullptr && IsSmooth(conductor->roughness);
}

// Half the diagonal of a box about the shape, in the world.
std::optional<double> RadiusOf(const SceneDescription& scene, const ShapeDescription& shape) {
  const Affine place = AffineOf(shape.world_from_object.start);
  const double scale = std::max({Length(place.x), Length(place.y), Length(place.z)});
  if (const auto* sphere = std::get_if<SphereShape>(&shape.shape)) {
    return scale * static_cast<double>(sphere->radius);
  }
  if (const auto* disk = std::get_if<DiskShape>(&shape.shape)) {
    return scale * static_cast<double>(disk->radius);
  }
  if (const auto* cylinder = std::get_if<CylinderShape>(&shape.shape)) {
    return scale * std::hypot(static_cast<double>(cylinder->radius),
                              0.5 * static_cast<double>(cylinder->z_max - cylinder->z_min));
  }
  const std::vector<Vec3f>* positions = nullptr;
  if (const auto* mesh = std::get_if<MeshShape>(&shape.shape)) {
    positions = &scene.meshes[mesh->mesh].positions;
  } else if (const auto* patches = std::get_if<BilinearMeshShape>(&shape.shape)) {
    const BilinearMesh& bilinear = scene.bilinear_meshes[patches->mesh];
    if (!IsTriangles(bilinear, shape.area_light != kNone)) return std::nullopt;
    positions = &bilinear.positions;
  }
  if (positions == nullptr || positions->empty()) return std::nullopt;
  Vec3d lower = place.Point(ToDouble((*positions)[0])), upper = lower;
  for (const Vec3f& position : *positions) {
    const Vec3d p = place.Point(ToDouble(position));
    for (size_t i = 0; i < 3; ++i) {
      lower[i] = std::min(lower[i], p[i]);
      upper[i] = std::max(upper[i], p[i]);
    }
  }
  return 0.5 * Length(upper - lower);
}

bool Deforms(const SceneDescription& scene, const ShapeDescription& shape) {
  const auto* mesh = std::get_if<MeshShape>(&shape.shape);
  return mesh != nullptr && !scene.meshes[mesh->mesh].steps.empty();
}

// Why chains do not lead through a smooth shape; empty if they do.
std::string WhyNoCaster(const SceneDescription& scene, const ShapeDescription& shape,
                        bool in_world) {
  const MaterialDescription& material = scene.materials[shape.material];
  if (!in_world) return "it belongs to an object";
  if (shape.world_from_object.IsAnimated() || Deforms(scene, shape)) return "it moves";
  if (material.normal_map != kNone || material.coat_normals.has_value() ||
      !IsZero(material.displacement))
    return "its normals have a map";
  if (shape.has_alpha) return "it has cut-outs";
  if (shape.area_light != kNone) return "it emits light";
  if (!RadiusOf(scene, shape)) return "it consists of patches or curves";
  return "";
}

// Why chains do not lead to an area light; empty if they do. radius_max: of lamps.
std::string WhyNoLamp(const SceneDescription& scene, const ShapeDescription& shape,
                      double radius_max) {
  const AreaLightDescription& light = scene.area_lights[shape.area_light];
  if (shape.world_from_object.IsAnimated() || Deforms(scene, shape)) return "it moves";
  if (!light.file.empty() || shape.has_alpha) return "its emission varies";
  const std::optional<double> radius = RadiusOf(scene, shape);
  const auto* disk = std::get_if<DiskShape>(&shape.shape);
  const auto* sphere = std::get_if<SphereShape>(&shape.shape);
  constexpr float kWhole = 360;
  const bool is_whole = disk != nullptr     ? disk->phi_max_degrees >= kWhole
                        : sphere != nullptr ? sphere->phi_max_degrees >= kWhole &&
                                                  sphere->z_min <= -sphere->radius &&
                                                  sphere->z_max >= sphere->radius
                                            : !std::holds_alternative<CylinderShape>(shape.shape);
  const bool is_quadric = disk != nullptr || sphere != nullptr;
  if (!radius || !is_whole ||
      (is_quadric && !KeepsAngles(AffineOf(shape.world_from_object.start)))) {
    return "it is no whole disk or sphere, and no mesh";
  }
  if (*radius > radius_max) return "it is large, so that paths hit it";
  return "";
}

// "what: LOCATION, LOCATION and 3 more".
class Places {
 public:
  explicit Places(const SceneDescription& scene) : scene_(scene) {}
  void Add(const SourceLocation& location, const std::string& reason = "") {
    if (++count_ > kNamedMax) return;
    absl::StrAppend(&text_, count_ == 1 ? "" : ", ", FormatLocation(scene_, location));
    if (!reason.empty()) absl::StrAppend(&text_, " (", reason, ")");
  }
  size_t count() const { return count_; }
  std::string Text() const {
    return count_ <= kNamedMax ? text_ : absl::StrCat(text_, " and ", count_ - kNamedMax, " more");
  }

 private:
  const SceneDescription& scene_;
  size_t count_ = 0;
  std::string text_;
};

struct Found {
  int32_t shape;
  double radius;
};

std::vector<bool> ShapesOfWorld(const SceneDescription& scene) {
  std::vector<bool> in_world(scene.shapes.size());
  for (const int32_t shape : scene.world_shapes) in_world[shape] = true;
  return in_world;
}

}  // namespace

ChainShapes FindChainShapes(const SceneDescription& scene) {
  const std::vector<bool> in_world = ShapesOfWorld(scene);
  std::vector<Found> found;
  Places no_casters(scene);
  for (size_t i = 0; i < scene.shapes.size(); ++i) {
    const ShapeDescription& shape = scene.shapes[i];
    if (shape.material == kNone || !IsSmoothInterface(scene.materials[shape.material])) continue;
    const std::string why_not = WhyNoCaster(scene, shape, in_world[i]);
    if (why_not.empty()) {
      found.push_back({static_cast<int32_t>(i), *RadiusOf(scene, shape)});
    } else {
      no_casters.Add(shape.location, why_not);
    }
  }
  std::ranges::stable_sort(found, [](Found a, Found b) { return a.radius > b.radius; });
  for (size_t i = kCastersMax; i < found.size(); ++i) {
    no_casters.Add(scene.shapes[found[i].shape].location,
                   absl::StrCat(kCastersMax, " others are larger"));
  }
  found.resize(std::min(found.size(), kCastersMax));
  ChainShapes shapes;
  Places casters(scene), lamps(scene), no_lamps(scene);
  const double radius_max = found.empty() ? 0 : found[0].radius * kLampRadiusMax;
  for (size_t i = 0; i < scene.shapes.size(); ++i) {
    const ShapeDescription& shape = scene.shapes[i];
    if (shape.area_light == kNone || !in_world[i] || found.empty()) continue;
    const std::string why_not = WhyNoLamp(scene, shape, radius_max);
    if (why_not.empty()) {
      shapes.lamps.push_back(static_cast<int32_t>(i));
      lamps.Add(shape.location);
    } else {
      no_lamps.Add(shape.location, why_not);
    }
  }
  if (!shapes.lamps.empty()) {
    for (const Found& caster : found) {
      shapes.casters.push_back(caster.shape);
      casters.Add(scene.shapes[caster.shape].location);
    }
    std::ranges::sort(shapes.casters);
  }
  shapes.notes.push_back(
      shapes.lamps.empty()
          ? absl::StrCat("chains: none; ",
                         found.empty() ? "no still shape is of smooth glass or metal"
                                       : "no still lamp is small against smooth glass or metal")
          : absl::StrCat("chains: through ", casters.count(), " smooth shapes, at ", casters.Text(),
                         ", to the small lamps at ", lamps.Text()));
  if (no_casters.count() > 0) {
    shapes.notes.push_back(absl::StrCat("chains: not through ", no_casters.Text()));
  }
  if (no_lamps.count() > 0) {
    shapes.notes.push_back(absl::StrCat("chains: not to the lights at ", no_lamps.Text()));
  }
  return shapes;
}

}  // namespace sheaf::render
