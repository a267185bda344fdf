// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Meshes: primitives of glTF meshes as triangle meshes (glTF 2.0 specification, sec. 3.7), read
// once each, and the forms that morph targets and skins give them at a time.
#pragma once

#include "common/scene/gltf/tinygltf_door.h"

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "common/math/transform.h"
#include "common/scene/gltf/accessors.h"
#include "common/scene/gltf/skipped_parts.h"
#include "common/scene/pbrt/syntax/diagnostics.h"
#include "common/scene/scene_description.h"

namespace sheaf::gltf {

inline constexpr size_t kMorphTargetsMax = 1024;
inline constexpr size_t kInfluencesMax = 16;  // Joints that move a vertex.

// A primitive as the file has it. Its uv is that of SceneDescription: v points upwards.
struct Primitive {
  TriangleMesh mesh;
  struct Target {
    std::vector<Vec3f> positions, normals;  // Offsets; each empty or one per vertex.
  };
  std::vector<Target> targets;
  // Per vertex `influences` joints with their weights, which sum to 1. Empty without a skin.
  size_t influences = 0;
  std::vector<uint32_t> joints;
  std::vector<float> weights;
  std::string emission;  // The image of PrimitiveUse::emits_colors, as PFM; empty without one.
};

// How a primitive is read beyond what the file says of it.
struct PrimitiveUse {
  // The material is unlit: an image over its uv is what its colors emit (vertex_emission.h).
  bool emits_colors = false;
  // The diagonal of the whole scene in the mesh's space, by which points and lines get a thickness;
  // 0: that of the primitive counts.
  double scene_diagonal = 1;
};

// Numbers of TEXCOORDs: of uv, and of a second set in place of colors (UvMapping::kSecondUv), if it
// is not -1.
struct UvSets {
  int first = 0, second = -1;
  auto operator<=>(const UvSets&) const = default;
};

inline uint64_t BytesOf(const TriangleMesh& mesh) {
  return (mesh.positions.size() + mesh.normals.size() + mesh.tangents.size()) * sizeof(Vec3f) +
         mesh.uvs.size() * sizeof(Vec2f) + mesh.colors.size() * sizeof(VertexColor) +
         mesh.indices.size() * sizeof(uint32_t);
}

class Meshes {
 public:
  // All arguments must outlive this.
  Meshes(const tinygltf::Model* model, Accessors* accessors, SkippedParts* skipped,
         Diagnostics* diagnostics, const SceneReaderLimits& limits)
      : model_(model),
        accessors_(accessors),
        skipped_(skipped),
        diagnostics_(diagnostics),
        triangles_left_(limits.triangles_max) {}

  // Null if there is nothing to draw, and after an error, which is reported. Points and lines
  // become spheres and tubes, with a note. sets: which TEXCOORDs become its uv. Read once for each
  // mesh, primitive, sets and use.emits_colors, as it is used first.
  const Primitive* Get(int mesh, size_t primitive, UvSets sets, const PrimitiveUse& use);

 private:
  struct Key {
    int mesh;
    size_t primitive;
    UvSets sets;
    bool emits_colors;
    auto operator<=>(const Key&) const = default;
  };
  std::optional<Primitive> Read(const Key& key, double scene_diagonal, const std::string& what);
  bool ReadVertices(const tinygltf::Primitive& source, UvSets sets, const std::string& what,
                    TriangleMesh* mesh);
  // One vector for each vertex, none if the primitive has no such set.
  bool ReadUvs(const tinygltf::Primitive& source, int set, size_t count, const std::string& what,
               std::vector<Vec2f>* uvs);
  // Tangents' fourth number, the side of v, follows from the uv.
  bool ReadTangents(int accessor, const std::string& what, TriangleMesh* mesh);
  bool ReadColors(int accessor, const std::string& what, TriangleMesh* mesh);
  std::optional<std::vector<uint32_t>> ReadList(const tinygltf::Primitive& source, size_t vertices,
                                                const std::string& what);
  bool ReadTriangles(const tinygltf::Primitive& source, const std::string& what,
                     TriangleMesh* mesh);
  // Spheres and tubes in place of points and lines.
  bool Thicken(const tinygltf::Primitive& source, double scene_diagonal, const std::string& what,
               Primitive* primitive);
  bool ChargeTriangles(uint64_t triangles, const std::string& what);
  bool ReadTargets(const tinygltf::Primitive& source, const std::string& what,
                   Primitive* primitive);
  bool ReadInfluences(const tinygltf::Primitive& source, const std::string& what,
                      Primitive* primitive);
  std::optional<std::vector<Vec3f>> Vectors(int accessor, size_t count, const std::string& what);
  bool HasCount(size_t count, size_t expected, const std::string& what);

  const tinygltf::Model* model_;
  Accessors* accessors_;
  SkippedParts* skipped_;
  Diagnostics* diagnostics_;
  uint64_t triangles_left_;
  std::map<Key, std::optional<Primitive>> known_;
};

}  // namespace sheaf::gltf
