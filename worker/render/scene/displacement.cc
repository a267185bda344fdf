// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/displacement.h"

#include <algorithm>
#include <array>
#include <map>
#include <string>
#include <tuple>
#include <utility>
#include <variant>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/load_phases.h"
#include "common/image/texture_cache.h"
#include "worker/render/geometry/displaced_mesh.h"
#include "worker/render/material/material.h"
#include "worker/render/material/texture_program.h"

namespace sheaf::render {
namespace {

// The textures that displacements use, by index, and whether any depends on positions.
class UsedTextures {
 public:
  explicit UsedTextures(const SceneDescription& scene)
      : scene_(scene), is_used_(scene.textures.size(), false) {}

  // Returns true if `texture`, or one that it reads, depends on the position.
  bool Add(int32_t texture) {
    if (texture == kNone) return false;
    is_used_[static_cast<size_t>(texture)] = true;
    return std::visit([this](const auto& t) { return AddInputs(t); },
                      scene_.textures[static_cast<size_t>(texture)].texture);
  }
  // The scene's textures, with unused ones replaced by constants.
  SceneDescription Program() const {
    SceneDescription program;
    program.files = scene_.files;
    program.textures = scene_.textures;
    for (size_t i = 0; i < is_used_.size(); ++i) {
      if (!is_used_[i]) program.textures[i].texture = ConstantTexture{};
    }
    return program;
  }

 private:
  bool AddInputs(const ConstantTexture&) { return false; }
  bool AddInputs(const ImageTexture& t) { return t.mapping.kind != UvMapping::Kind::kUv; }
  bool AddInputs(const CheckerboardTexture& t) {
    const bool first = Add(t.value[0].texture), second = Add(t.value[1].texture);
    return first || second || t.dimensions == 3 || t.mapping.kind != UvMapping::Kind::kUv;
  }
  bool AddInputs(const ScaleTexture& t) {
    const bool value = Add(t.value.texture), scale = Add(t.scale.texture);
    return value || scale;
  }
  bool AddInputs(const MixTexture& t) {
    const bool first = Add(t.value[0].texture), second = Add(t.value[1].texture),
               amount = Add(t.amount.texture);
    return first || second || amount;
  }

  bool AddInputs(const VertexColorTexture& t) { return Add(t.value.texture); }
  bool AddInputs(const NoiseTexture&) { return true; }
  bool AddInputs(const MarbleTexture&) { return false; }  // No float texture.
  bool AddInputs(const DotsTexture& t) {
    const bool inside = Add(t.value[0].texture), outside = Add(t.value[1].texture);
    return inside || outside || t.mapping.kind != UvMapping::Kind::kUv;
  }
  // Vertices have no geometric normal: the second input displaces them, as in pbrt-v4.
  bool AddInputs(const DirectionMixTexture& t) {
    const bool along = Add(t.value[0].texture), across = Add(t.value[1].texture);
    return along || across;
  }
  bool AddInputs(const BilerpTexture& t) { return t.mapping.kind != UvMapping::Kind::kUv; }
  bool AddInputs(const NodeTexture& t) {
    return !t.from_uv && t.kind != NodeTexture::Kind::kAttribute;
  }
  bool AddInputs(const RampTexture& t) { return Add(t.input.texture); }

  const SceneDescription& scene_;
  std::vector<bool> is_used_;
};

// Everything that determines a displaced mesh.
using MeshKey = std::tuple<int32_t, int32_t, float, float, std::array<double, 12>>;

MeshKey KeyOf(const MeshShape& shape, const Matrix4& transform, bool reads_place) {
  std::array<double, 12> numbers{};
  for (size_t row = 0; row < 3; ++row) {
    for (size_t column = 0; column < (reads_place ? 4 : 3); ++column) {
      numbers[4 * row + column] = transform.m[row][column];
    }
  }
  return {shape.mesh, shape.displacement.texture, shape.displacement.value, shape.edge_length,
          numbers};
}

std::vector<int32_t> UsedShapes(const SceneDescription& scene) {
  std::vector<int32_t> shapes = scene.world_shapes;
  for (const ObjectDefinition& object : scene.objects) {
    shapes.insert(shapes.end(), object.shapes.begin(), object.shapes.end());
  }
  return shapes;
}

class Displacer {
 public:
  Displacer(const TextureProgram& program, uint64_t triangles_max, SceneDescription* scene)
      : program_(program), triangles_left_(triangles_max), scene_(*scene) {}

  absl::Status Displace(ShapeDescription* shape, bool reads_place) {
    auto& mesh_shape = std::get<MeshShape>(shape->shape);
    const FloatOperand operand = program_.Operand(mesh_shape.displacement);
    if (operand.texture != kNone || operand.value != 0) {
      const Matrix4& transform = shape->world_from_object.start;
      const auto [entry, is_new] =
          mesh_of_.emplace(KeyOf(mesh_shape, transform, reads_place), kNone);
      if (is_new) {
        absl::StatusOr<int32_t> mesh = AddMesh(mesh_shape, operand, AffineOf(transform));
        if (!mesh.ok()) {
          return absl::Status(mesh.status().code(),
                              absl::StrCat(FormatLocation(scene_, shape->location),
                                           ": Shape: ", std::string(mesh.status().message())));
        }
        entry->second = *mesh;
      }
      mesh_shape.mesh = entry->second;
    }
    mesh_shape.displacement = {0, kNone};
    return absl::OkStatus();
  }

 private:
  absl::StatusOr<int32_t> AddMesh(const MeshShape& shape, const FloatOperand& operand,
                                  const Affine& world_from_object) {
    if (!scene_.meshes[static_cast<size_t>(shape.mesh)].steps.empty()) {
      return absl::InvalidArgumentError("a mesh that deforms cannot be displaced");
    }
    const auto height = [&](Vec2f uv, Vec3d p) {
      return program_.Float(operand, {uv, world_from_object.Point(p), {}});
    };
    absl::StatusOr<TriangleMesh> mesh =
        DisplaceMesh(scene_.meshes[static_cast<size_t>(shape.mesh)], world_from_object,
                     static_cast<double>(shape.edge_length), triangles_left_, height);
    if (!mesh.ok()) return mesh.status();
    triangles_left_ -= std::min<uint64_t>(triangles_left_, mesh->indices.size() / 3);
    scene_.meshes.push_back(*std::move(mesh));
    return static_cast<int32_t>(scene_.meshes.size() - 1);
  }

  const TextureProgram& program_;
  uint64_t triangles_left_;
  SceneDescription& scene_;
  std::map<MeshKey, int32_t> mesh_of_;
};

}  // namespace

absl::Status DisplaceMeshes(FileSource& files, const DisplacementLimits& limits,
                            SceneDescription* scene) {
  const PhaseTimer timer(LoadPhase::kGeometry);
  UsedTextures used(*scene);
  std::vector<std::pair<int32_t, bool>> displaced;  // Shapes, and whether positions matter.
  for (const int32_t index : UsedShapes(*scene)) {
    const auto* mesh = std::get_if<MeshShape>(&scene->shapes[static_cast<size_t>(index)].shape);
    if (mesh == nullptr || !mesh->IsDisplaced()) continue;
    displaced.emplace_back(index, used.Add(mesh->displacement.texture));
  }
  if (displaced.empty()) return absl::OkStatus();
  TextureCache cache(limits.texture_cache_bytes_max);
  const absl::StatusOr<TextureProgram> program =
      TextureProgram::Build(used.Program(), files, cache, /*spectral=*/false);
  if (!program.ok()) return program.status();
  Displacer displacer(*program, limits.triangles_max, scene);
  for (const auto& [index, reads_place] : displaced) {
    const absl::Status status =
        displacer.Displace(&scene->shapes[static_cast<size_t>(index)], reads_place);
    if (!status.ok()) return status;
  }
  std::vector<bool> is_used(scene->meshes.size(), false);
  for (const int32_t index : UsedShapes(*scene)) {
    const auto* mesh = std::get_if<MeshShape>(&scene->shapes[static_cast<size_t>(index)].shape);
    if (mesh != nullptr) is_used[static_cast<size_t>(mesh->mesh)] = true;
  }
  for (size_t i = 0; i < is_used.size(); ++i) {
    if (!is_used[i]) scene->meshes[i] = {};
  }
  return absl::OkStatus();
}

}  // namespace sheaf::render
