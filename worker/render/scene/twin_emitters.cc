// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/twin_emitters.h"

#include <algorithm>
#include <cstddef>
#include <tuple>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "absl/container/flat_hash_map.h"
#include "absl/hash/hash.h"
#include "absl/strings/str_cat.h"
#include "common/base/log.h"

namespace sheaf::render {
namespace {

bool AreEqual(const FloatInput& a, const FloatInput& b) {
  return a.value == b.value && a.texture == b.texture;
}
bool AreEqual(const TriangleMesh& a, const TriangleMesh& b) {
  const auto is_equal_step = [](const VertexStep& s, const VertexStep& t) {
    return s.positions == t.positions && s.normals == t.normals;
  };
  return a.indices == b.indices && a.positions == b.positions && a.normals == b.normals &&
         a.uvs == b.uvs && a.tangents == b.tangents && a.colors == b.colors &&
         std::ranges::equal(a.steps, b.steps, is_equal_step);
}
bool AreEqual(const BilinearMesh& a, const BilinearMesh& b) {
  return a.indices == b.indices && a.positions == b.positions && a.normals == b.normals &&
         a.uvs == b.uvs;
}
bool AreEqual(const ColorSpec& a, const ColorSpec& b) {
  const auto fields = [](const ColorSpec& c) {
    return std::tie(c.kind, c.rgb, c.is_out_of_gamut, c.true_rgb, c.wavelengths_nm, c.values,
                    c.name, c.temperature_k);
  };
  return fields(a) == fields(b);
}
bool AreEqual(const UvMapping& a, const UvMapping& b) {
  const auto fields = [](const UvMapping& m) {
    return std::tie(m.kind, m.scale_u, m.scale_v, m.offset_u, m.offset_v, m.turn_u, m.turn_v,
                    m.texture_from_world);
  };
  return fields(a) == fields(b);
}
bool AreEqual(const AreaLightDescription& a, const AreaLightDescription& b) {
  const auto fields = [](const AreaLightDescription& light) {
    const EmissionPlacement& placement = light.placement;
    return std::tie(light.scale.scale, light.scale.power_w, light.two_sided, light.group,
                    light.file, light.tint, placement.wrap_u, placement.wrap_v,
                    placement.is_nearest);
  };
  return fields(a) == fields(b) && AreEqual(a.radiance, b.radiance) &&
         AreEqual(a.placement.mapping, b.placement.mapping);
}
bool AreEqual(const TransformOverTime& a, const TransformOverTime& b) {
  const bool is_animated = a.IsAnimated();
  return a.start == b.start && a.end == b.end &&
         (!is_animated || (a.start_time == b.start_time && a.end_time == b.end_time));
}

class Emitters {
 public:
  explicit Emitters(const SceneDescription& scene) : scene_(scene) {}

  // The earlier shape that equals this one; kNone if there is none.
  int32_t TwinOf(int32_t index) {
    std::vector<int32_t>& alike = by_hash_[HashOf(scene_.shapes[index])];
    for (const int32_t earlier : alike) {
      if (AreTwins(scene_.shapes[earlier], scene_.shapes[index])) return earlier;
    }
    alike.push_back(index);
    return kNone;
  }

 private:
  template <typename Mesh>
  static size_t HashOfMesh(const Mesh& mesh) {
    const Vec3f first = mesh.positions.empty() ? Vec3f{} : mesh.positions.front();
    return absl::HashOf(mesh.positions.size(), mesh.indices.size(), first.x, first.y, first.z);
  }
  const TriangleMesh& MeshOf(const MeshShape& shape) const { return scene_.meshes[shape.mesh]; }
  const BilinearMesh& MeshOf(const BilinearMeshShape& shape) const {
    return scene_.bilinear_meshes[shape.mesh];
  }

  size_t HashOf(const ShapeDescription& shape) const {
    const Matrix4& place = shape.world_from_object.start;
    const size_t of_shape = std::visit(
        [this](const auto& kind) -> size_t {
          using Kind = std::decay_t<decltype(kind)>;
          if constexpr (std::is_same_v<Kind, CurveShape>) {
            return absl::HashOf(kind.curves);
          } else if constexpr (std::is_same_v<Kind, MeshShape> ||
                               std::is_same_v<Kind, BilinearMeshShape>) {
            return HashOfMesh(MeshOf(kind));
          } else {
            return absl::HashOf(kind.radius, kind.phi_max_degrees);
          }
        },
        shape.shape);
    return absl::HashOf(of_shape, shape.shape.index(), place.m[0][3], place.m[1][3], place.m[2][3]);
  }

  // False for curves, which each have a set of their own.
  bool AreEqualShapes(const ShapeDescription& a, const ShapeDescription& b) const {
    return std::visit(
        [&](const auto& s) {
          using Kind = std::decay_t<decltype(s)>;
          const Kind& t = std::get<Kind>(b.shape);
          if constexpr (std::is_same_v<Kind, MeshShape>) {
            return AreEqual(s.displacement, t.displacement) && s.edge_length == t.edge_length &&
                   (s.mesh == t.mesh || AreEqual(MeshOf(s), MeshOf(t)));
          } else if constexpr (std::is_same_v<Kind, BilinearMeshShape>) {
            return AreEqual(MeshOf(s), MeshOf(t));
          } else if constexpr (std::is_same_v<Kind, DiskShape>) {
            return std::tie(s.radius, s.inner_radius, s.height, s.phi_max_degrees) ==
                   std::tie(t.radius, t.inner_radius, t.height, t.phi_max_degrees);
          } else if constexpr (std::is_same_v<Kind, CurveShape>) {
            return false;
          } else {
            return std::tie(s.radius, s.z_min, s.z_max, s.phi_max_degrees) ==
                   std::tie(t.radius, t.z_min, t.z_max, t.phi_max_degrees);
          }
        },
        a.shape);
  }

  bool AreEqualMaterials(int32_t a, int32_t b) const {
    if (a == b || a == kNone || b == kNone) return a == b;
    const int32_t alike = scene_.materials[a].first_alike;
    return alike != kNone && alike == scene_.materials[b].first_alike;
  }

  bool AreTwins(const ShapeDescription& a, const ShapeDescription& b) const {
    return a.shape.index() == b.shape.index() && AreEqualMaterials(a.material, b.material) &&
           a.reverse_orientation == b.reverse_orientation && a.has_alpha == b.has_alpha &&
           a.invisible == b.invisible && AreEqual(a.alpha, b.alpha) &&
           a.media.inside == b.media.inside && a.media.outside == b.media.outside &&
           AreEqual(a.world_from_object, b.world_from_object) &&
           AreEqual(scene_.area_lights[a.area_light], scene_.area_lights[b.area_light]) &&
           AreEqualShapes(a, b);
  }

  const SceneDescription& scene_;
  absl::flat_hash_map<size_t, std::vector<int32_t>> by_hash_;
};

}  // namespace

void RemoveTwinEmitters(SceneDescription* scene) {
  Emitters emitters(*scene);
  size_t count = 0;
  int32_t first = kNone, first_twin = kNone;
  std::erase_if(scene->world_shapes, [&](int32_t index) {
    if (scene->shapes[index].area_light == kNone) return false;
    const int32_t twin = emitters.TwinOf(index);
    if (twin == kNone) return false;
    if (count++ == 0) std::tie(first, first_twin) = std::pair{index, twin};
    return true;
  });
  if (count == 0) return;
  LogWarning(absl::StrCat(FormatLocation(*scene, scene->shapes[first].location),
                          ": this emissive shape is given twice, first at ",
                          FormatLocation(*scene, scene->shapes[first_twin].location),
                          "; it counts once", count > 1 ? ", as do " : "",
                          count > 1 ? absl::StrCat(count - 1, " more") : ""));
}

}  // namespace sheaf::render
