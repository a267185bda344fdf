// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/meshes.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/scene/gltf/thin_shapes.h"
#include "common/scene/gltf/values.h"
#include "common/scene/gltf/vertex_emission.h"

namespace sheaf::gltf {
namespace {

int AttributeOf(const std::map<std::string, int>& attributes, const std::string& name) {
  const auto found = attributes.find(name);
  return found == attributes.end() ? -1 : found->second;
}

// Corners of the triangles of a list of vertices. Source: glTF 2.0 specification, sec. 3.7.2.1.
std::vector<uint32_t> TrianglesOf(int mode, std::vector<uint32_t> list) {
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    list.resize(list.size() / 3 * 3);
    return list;
  }
  std::vector<uint32_t> triangles;
  for (size_t i = 0; i + 2 < list.size(); ++i) {
    if (mode == TINYGLTF_MODE_TRIANGLE_STRIP) {
      triangles.insert(triangles.end(), {list[i], list[i + 1 + i % 2], list[i + 2 - i % 2]});
    } else {
      triangles.insert(triangles.end(), {list[i + 1], list[i + 2], list[0]});
    }
  }
  return triangles;
}

}  // namespace

bool Meshes::HasCount(size_t count, size_t expected, const std::string& what) {
  if (count == expected) return true;
  diagnostics_->Error(kFile, absl::StrCat(what, " has ", count, " values for ", expected,
                                          " vertices; export the file again"));
  return false;
}

std::optional<std::vector<Vec3f>> Meshes::Vectors(int accessor, size_t count,
                                                  const std::string& what) {
  const std::optional<std::vector<float>> numbers = accessors_->Floats(accessor, 3, what);
  if (!numbers || (count > 0 && !HasCount(numbers->size() / 3, count, what))) return std::nullopt;
  std::vector<Vec3f> vectors(numbers->size() / 3);
  for (size_t i = 0; i < vectors.size(); ++i) {
    vectors[i] = {(*numbers)[3 * i], (*numbers)[3 * i + 1], (*numbers)[3 * i + 2]};
  }
  return vectors;
}

bool Meshes::ReadColors(int accessor, const std::string& what, TriangleMesh* mesh) {
  const bool has_alpha =
      HasIndex(model_->accessors, accessor) &&
      model_->accessors[static_cast<size_t>(accessor)].type == TINYGLTF_TYPE_VEC4;
  const size_t components = has_alpha ? 4 : 3;
  const std::optional<std::vector<float>> numbers =
      accessors_->Floats(accessor, static_cast<int>(components), what);
  if (!numbers || !HasCount(numbers->size() / components, mesh->positions.size(), what)) {
    return false;
  }
  mesh->colors.resize(mesh->positions.size(), {1, 1, 1, 1});
  size_t outside = 0;
  for (size_t i = 0; i < numbers->size(); ++i) {
    const float value = (*numbers)[i];
    const bool is_inside = value >= 0 && value <= 1;  // Not for NaN.
    outside += !is_inside;
    mesh->colors[i / components][i % components] = is_inside ? value : value > 1 ? 1.0f : 0.0f;
  }
  if (outside > 0) skipped_->Add(what, "has numbers outside of 0 to 1, which are clamped");
  return true;
}

bool Meshes::ReadUvs(const tinygltf::Primitive& source, int set, size_t count,
                     const std::string& what, std::vector<Vec2f>* uvs) {
  const std::string name = absl::StrCat("TEXCOORD_", set);
  const int accessor = AttributeOf(source.attributes, name);
  if (accessor < 0) {
    if (set > 0) {
      skipped_->Add(what, absl::StrCat("there is no ", name,
                                       ", which the material's textures use; they are placed by "
                                       "triangles"));
    }
    return true;
  }
  const std::string uv_what = absl::StrCat(what, ", ", name);
  const std::optional<std::vector<float>> numbers = accessors_->Floats(accessor, 2, uv_what);
  if (!numbers || !HasCount(numbers->size() / 2, count, uv_what)) return false;
  uvs->resize(count);
  // The file's v points downwards.
  for (size_t i = 0; i < count; ++i) (*uvs)[i] = {(*numbers)[2 * i], 1 - (*numbers)[2 * i + 1]};
  return true;
}

bool Meshes::ReadTangents(int accessor, const std::string& what, TriangleMesh* mesh) {
  const std::optional<std::vector<float>> numbers = accessors_->Floats(accessor, 4, what);
  const size_t count = mesh->positions.size();
  if (!numbers || !HasCount(numbers->size() / 4, count, what)) return false;
  mesh->tangents.resize(count);
  for (size_t i = 0; i < count; ++i) {
    mesh->tangents[i] = {(*numbers)[4 * i], (*numbers)[4 * i + 1], (*numbers)[4 * i + 2]};
  }
  return true;
}

bool Meshes::ReadVertices(const tinygltf::Primitive& source, UvSets sets, const std::string& what,
                          TriangleMesh* mesh) {
  const int positions = AttributeOf(source.attributes, "POSITION");
  std::optional<std::vector<Vec3f>> read = Vectors(positions, 0, what + ", POSITION");
  if (!read) return false;
  mesh->positions = *std::move(read);
  const size_t count = mesh->positions.size();
  if (const int normals = AttributeOf(source.attributes, "NORMAL"); normals >= 0) {
    read = Vectors(normals, count, what + ", NORMAL");
    if (!read) return false;
    mesh->normals = *std::move(read);
  }
  if (!ReadUvs(source, sets.first, count, what, &mesh->uvs)) return false;
  if (const int colors = AttributeOf(source.attributes, "COLOR_0"); colors >= 0) {
    if (!ReadColors(colors, what + ", COLOR_0", mesh)) return false;
  } else if (sets.second >= 0) {
    std::vector<Vec2f> uvs;
    if (!ReadUvs(source, sets.second, count, what, &uvs)) return false;
    for (const Vec2f uv : uvs) mesh->colors.push_back({uv.x, uv.y, 1, 1});
  }
  if (const int tangents = AttributeOf(source.attributes, "TANGENT"); tangents >= 0) {
    if (!ReadTangents(tangents, what + ", TANGENT", mesh)) return false;
  }
  return true;
}

std::optional<std::vector<uint32_t>> Meshes::ReadList(const tinygltf::Primitive& source,
                                                      size_t vertices, const std::string& what) {
  if (source.indices < 0) {
    std::vector<uint32_t> list(vertices);
    for (size_t i = 0; i < list.size(); ++i) list[i] = static_cast<uint32_t>(i);
    return list;
  }
  std::optional<std::vector<uint32_t>> list =
      accessors_->Integers(source.indices, 1, what + ", indices");
  if (!list) return std::nullopt;
  // Lines start again behind the greatest index of a type (EXT_mesh_primitive_restart), which the
  // core format forbids.
  const bool is_thin = source.mode >= 0 && source.mode < TINYGLTF_MODE_TRIANGLES;
  const int type = model_->accessors[static_cast<size_t>(source.indices)].componentType;
  const uint32_t greatest = type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE    ? 0xff
                            : type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ? 0xffff
                                                                             : kRestart;
  for (uint32_t& index : *list) {
    if (index < vertices) continue;
    if (is_thin && index == greatest) {
      index = kRestart;
      continue;
    }
    diagnostics_->Error(kFile, absl::StrCat(what, " has the index ", index, ", but only ", vertices,
                                            " vertices; export the file again"));
    return std::nullopt;
  }
  return list;
}

bool Meshes::ChargeTriangles(uint64_t triangles, const std::string& what) {
  if (triangles > triangles_left_) {
    diagnostics_->MemoryError(kFile, absl::StrCat(what,
                                                  ": the scene has more triangles than the "
                                                  "limit; simplify it"));
    return false;
  }
  triangles_left_ -= triangles;
  return true;
}

bool Meshes::ReadTriangles(const tinygltf::Primitive& source, const std::string& what,
                           TriangleMesh* mesh) {
  const int mode = source.mode < 0 ? TINYGLTF_MODE_TRIANGLES : source.mode;
  std::optional<std::vector<uint32_t>> list = ReadList(source, mesh->positions.size(), what);
  if (!list) return false;
  if (mode == TINYGLTF_MODE_TRIANGLES && list->size() % 3 != 0) {
    skipped_->Add(what, "the last triangle lacks corners, and is left out");
  }
  if (mode != TINYGLTF_MODE_TRIANGLES && !accessors_->Charge(8 * list->size())) return false;
  mesh->indices = TrianglesOf(mode, *std::move(list));
  return ChargeTriangles(mesh->indices.size() / 3, what);
}

bool Meshes::Thicken(const tinygltf::Primitive& source, double scene_diagonal,
                     const std::string& what, Primitive* primitive) {
  const std::optional<std::vector<uint32_t>> list =
      ReadList(source, primitive->mesh.positions.size(), what);
  if (!list) return false;
  const bool has_points = source.mode == TINYGLTF_MODE_POINTS;
  const auto segments =
      has_points ? decltype(SegmentsOf(0, *list))() : SegmentsOf(source.mode, *list);
  const ThinCost cost = has_points ? CostOfPoints(list->size()) : CostOfSegments(segments.size());
  const TriangleMesh& mesh = primitive->mesh;
  const uint64_t bytes_of_vertex = 2 * sizeof(Vec3f) + (mesh.uvs.empty() ? 0 : sizeof(Vec2f)) +
                                   (mesh.colors.empty() ? 0 : sizeof(VertexColor)) +
                                   primitive->targets.size() * sizeof(Vec3f) +
                                   primitive->influences * 2 * sizeof(float);
  if (!ChargeTriangles(cost.triangles, what) ||
      !accessors_->Charge(cost.vertices * bytes_of_vertex +
                          3 * sizeof(uint32_t) * cost.triangles)) {
    return false;
  }
  if (!(scene_diagonal > 0)) scene_diagonal = DiagonalOf(primitive->mesh.positions);
  if (has_points) {
    MakeSpheres(*list, static_cast<float>(scene_diagonal * kPointRadius), primitive);
    skipped_->Add(what, "points are spheres, 1/500 of the scene's diagonal in radius");
  } else {
    MakeTubes(segments, static_cast<float>(scene_diagonal * kLineRadius), primitive);
    skipped_->Add(what, "lines are tubes, 1/1000 of the scene's diagonal in radius");
  }
  return true;
}

bool Meshes::ReadTargets(const tinygltf::Primitive& source, const std::string& what,
                         Primitive* primitive) {
  if (source.targets.size() > kMorphTargetsMax) {
    diagnostics_->Error(kFile, absl::StrCat(what, " has ", source.targets.size(),
                                            " morph targets, the limit is ", kMorphTargetsMax));
    return false;
  }
  const size_t count = primitive->mesh.positions.size();
  for (const std::map<std::string, int>& attributes : source.targets) {
    Primitive::Target target;
    const int positions = AttributeOf(attributes, "POSITION");
    if (positions >= 0) {
      auto read = Vectors(positions, count, what + ", POSITION of a morph target");
      if (!read) return false;
      target.positions = *std::move(read);
    }
    const int normals = AttributeOf(attributes, "NORMAL");
    if (normals >= 0 && !primitive->mesh.normals.empty()) {
      auto read = Vectors(normals, count, what + ", NORMAL of a morph target");
      if (!read) return false;
      target.normals = *std::move(read);
    }
    for (const auto& [name, accessor] : attributes) {
      if (name.starts_with("TEXCOORD_") || name.starts_with("COLOR_")) {
        skipped_->Add(what, "morph targets of uv and colors have no effect");
      }
    }
    primitive->targets.push_back(std::move(target));
  }
  return true;
}

bool Meshes::ReadInfluences(const tinygltf::Primitive& source, const std::string& what,
                            Primitive* primitive) {
  const size_t count = primitive->mesh.positions.size();
  std::vector<std::vector<uint32_t>> joints;
  std::vector<std::vector<float>> weights;
  for (size_t set = 0; 4 * set < kInfluencesMax; ++set) {
    const int joint = AttributeOf(source.attributes, absl::StrCat("JOINTS_", set));
    const int weight = AttributeOf(source.attributes, absl::StrCat("WEIGHTS_", set));
    if (joint < 0 && weight < 0) break;
    if (joint < 0 || weight < 0) {
      skipped_->Add(what, "joints without weights, and weights without joints, have no effect");
      break;
    }
    const std::string name = absl::StrCat(what, ", joints ", set);
    auto read_joints = accessors_->Integers(joint, 4, name);
    auto read_weights = accessors_->Floats(weight, 4, name);
    if (!read_joints || !read_weights || !HasCount(read_joints->size() / 4, count, name) ||
        !HasCount(read_weights->size() / 4, count, name)) {
      return false;
    }
    joints.push_back(*std::move(read_joints));
    weights.push_back(*std::move(read_weights));
  }
  if (AttributeOf(source.attributes, absl::StrCat("JOINTS_", kInfluencesMax / 4)) >= 0) {
    skipped_->Add(what, absl::StrCat("joints beyond ", kInfluencesMax,
                                     " a vertex have no effect; export with fewer"));
  }
  primitive->influences = 4 * joints.size();
  for (size_t v = 0; v < count && !joints.empty(); ++v) {
    float sum = 0;
    for (const std::vector<float>& set : weights) {
      for (size_t k = 0; k < 4; ++k) sum += std::fmax(set[4 * v + k], 0.0f);
    }
    for (size_t set = 0; set < joints.size(); ++set) {
      for (size_t k = 0; k < 4; ++k) {
        const float weight = std::fmax(weights[set][4 * v + k], 0.0f);
        primitive->joints.push_back(joints[set][4 * v + k]);
        primitive->weights.push_back(sum > 0 ? weight / sum : 0);
      }
    }
  }
  return true;
}

std::optional<Primitive> Meshes::Read(const Key& key, double scene_diagonal,
                                      const std::string& what) {
  const tinygltf::Primitive& source =
      model_->meshes[static_cast<size_t>(key.mesh)].primitives[key.primitive];
  const int mode = source.mode < 0 ? TINYGLTF_MODE_TRIANGLES : source.mode;
  if (mode > TINYGLTF_MODE_TRIANGLE_FAN) {
    diagnostics_->Error(kFile, absl::StrCat(what, " has the mode ", mode,
                                            ", which is none of 0 to 6; export the file again"));
    return std::nullopt;
  }
  const bool is_thin = mode < TINYGLTF_MODE_TRIANGLES;
  Primitive primitive;
  if (!ReadVertices(source, key.sets, what, &primitive.mesh) ||
      (!is_thin && !ReadTriangles(source, what, &primitive.mesh)) ||
      !ReadTargets(source, what, &primitive) || !ReadInfluences(source, what, &primitive) ||
      (is_thin && !Thicken(source, scene_diagonal, what, &primitive))) {
    return std::nullopt;
  }
  if (primitive.mesh.indices.empty()) {
    skipped_->Add(what, "it has no triangles, and is left out");
    return std::nullopt;
  }
  if (!key.emits_colors || primitive.mesh.colors.empty()) return primitive;
  // At most three vertices a triangle, and its texels.
  if (!accessors_->Charge(3 * BytesOf(primitive.mesh) + 16 * primitive.mesh.indices.size())) {
    return std::nullopt;
  }
  primitive.emission = SeparateColors(&primitive);
  if (primitive.emission.empty()) {
    skipped_->Add(what, absl::StrCat("more than ", kEmissionSquaresMax,
                                     " triangles of different colors emit none of them"));
  }
  return primitive;
}

const Primitive* Meshes::Get(int mesh, size_t primitive, UvSets sets, const PrimitiveUse& use) {
  const Key key{mesh, primitive, sets, use.emits_colors};
  const auto [entry, is_new] = known_.try_emplace(key);
  if (is_new) {
    const std::string what =
        absl::StrCat(Named("mesh", mesh, model_->meshes[static_cast<size_t>(mesh)].name),
                     ", primitive ", primitive);
    entry->second = Read(key, use.scene_diagonal, what);
  }
  return entry->second ? &*entry->second : nullptr;
}

}  // namespace sheaf::gltf
