// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/thin_shapes.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/math/elementary.h"
#include "common/math/frame.h"
#include "common/scene/gltf/values.h"

namespace sheaf::gltf {
namespace {

// A closed shape by its corners, of any length, and its faces, counter-clockwise from outside.
struct Solid {
  std::vector<Vec3f> corners;
  std::vector<std::array<uint32_t, 3>> faces;
};

Solid Icosahedron() {
  constexpr float kGolden = 1.618034f;
  return {{{-1, kGolden, 0},
           {1, kGolden, 0},
           {-1, -kGolden, 0},
           {1, -kGolden, 0},
           {0, -1, kGolden},
           {0, 1, kGolden},
           {0, -1, -kGolden},
           {0, 1, -kGolden},
           {kGolden, 0, -1},
           {kGolden, 0, 1},
           {-kGolden, 0, -1},
           {-kGolden, 0, 1}},
          {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
           {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
           {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}}};
}

Solid Octahedron() {
  return {{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}},
          {{0, 2, 4}, {2, 1, 4}, {1, 3, 4}, {3, 0, 4}, {2, 0, 5}, {1, 2, 5}, {3, 1, 5}, {0, 3, 5}}};
}

struct Box {
  Vec3d low{}, high{};
  bool is_empty = true;

  void Add(Vec3d p) {
    for (size_t c = 0; c < 3; ++c) {
      low[c] = is_empty ? p[c] : std::min(low[c], p[c]);
      high[c] = is_empty ? p[c] : std::max(high[c], p[c]);
    }
    is_empty = false;
  }
  // 0 if it is not finite.
  double Diagonal() const {
    const double diagonal = Length(high - low);
    return std::isfinite(diagonal) ? diagonal : 0;
  }
};

// A primitive whose vertices are made from those of another one.
class Expansion {
 public:
  explicit Expansion(const Primitive& source) : source_(source) {
    made_.targets.resize(source.targets.size());
    made_.influences = source.influences;
  }

  // A vertex at the distance from the source's one, with that unit normal.
  uint32_t Add(uint32_t vertex, Vec3f normal, float distance) {
    const TriangleMesh& mesh = source_.mesh;
    made_.mesh.positions.push_back(mesh.positions[vertex] + distance * normal);
    made_.mesh.normals.push_back(normal);
    if (!mesh.uvs.empty()) made_.mesh.uvs.push_back(mesh.uvs[vertex]);
    if (!mesh.colors.empty()) made_.mesh.colors.push_back(mesh.colors[vertex]);
    for (size_t t = 0; t < source_.targets.size(); ++t) {
      const std::vector<Vec3f>& moves = source_.targets[t].positions;
      if (!moves.empty()) made_.targets[t].positions.push_back(moves[vertex]);
    }
    for (size_t k = 0; k < source_.influences; ++k) {
      made_.joints.push_back(source_.joints[vertex * source_.influences + k]);
      made_.weights.push_back(source_.weights[vertex * source_.influences + k]);
    }
    return static_cast<uint32_t>(made_.mesh.positions.size() - 1);
  }
  void AddTriangle(uint32_t a, uint32_t b, uint32_t c) {
    made_.mesh.indices.insert(made_.mesh.indices.end(), {a, b, c});
  }
  Primitive Take() { return std::move(made_); }

 private:
  const Primitive& source_;
  Primitive made_;
};

}  // namespace

double SceneDiagonal(const tinygltf::Model& model, const std::vector<int>& shown,
                     const std::vector<Matrix4>& world) {
  Box box;
  for (const int n : shown) {
    const tinygltf::Node& node = model.nodes[static_cast<size_t>(n)];
    if (!HasIndex(model.meshes, node.mesh)) continue;
    for (const auto& primitive : model.meshes[static_cast<size_t>(node.mesh)].primitives) {
      const auto found = primitive.attributes.find("POSITION");
      if (found == primitive.attributes.end() || !HasIndex(model.accessors, found->second))
        continue;
      const auto& accessor = model.accessors[static_cast<size_t>(found->second)];
      if (accessor.minValues.size() != 3 || accessor.maxValues.size() != 3) continue;
      for (size_t corner = 0; corner < 8; ++corner) {
        const auto at = [&](size_t c) {
          return (corner >> c & 1) != 0 ? accessor.minValues[c] : accessor.maxValues[c];
        };
        box.Add(TransformPoint(world[static_cast<size_t>(n)], {at(0), at(1), at(2)}));
      }
    }
  }
  return box.Diagonal();
}

double DiagonalOf(const std::vector<Vec3f>& points) {
  Box box;
  for (const Vec3f& p : points) box.Add(ToDouble(p));
  const double diagonal = box.Diagonal();
  return diagonal > 0 ? diagonal : 1;
}

double LargestScale(const Matrix4& world) {
  double scale = 0;
  for (size_t c = 0; c < 3; ++c) {
    scale = std::max(scale, Length(Vec3d{world.m[0][c], world.m[1][c], world.m[2][c]}));
  }
  return scale > 0 && std::isfinite(scale) ? scale : 1;
}

std::vector<std::pair<uint32_t, uint32_t>> SegmentsOf(int mode, const std::vector<uint32_t>& list) {
  std::vector<std::pair<uint32_t, uint32_t>> segments;
  const size_t step = mode == TINYGLTF_MODE_LINE ? 2 : 1;
  for (size_t begin = 0; begin < list.size();) {
    const auto restart =
        std::find(list.begin() + static_cast<int64_t>(begin), list.end(), kRestart);
    const auto end = static_cast<size_t>(restart - list.begin());
    for (size_t i = begin; i + 1 < end; i += step) segments.emplace_back(list[i], list[i + 1]);
    if (mode == TINYGLTF_MODE_LINE_LOOP && end > begin + 2) {
      segments.emplace_back(list[end - 1], list[begin]);
    }
    begin = end + 1;
  }
  return segments;
}

void MakeSpheres(const std::vector<uint32_t>& points, float radius, Primitive* primitive) {
  Expansion expansion(*primitive);
  const Solid solid = points.size() <= kRoundMax ? Icosahedron() : Octahedron();
  std::vector<uint32_t> made(solid.corners.size());
  for (const uint32_t point : points) {
    if (point == kRestart) continue;
    for (size_t i = 0; i < made.size(); ++i) {
      made[i] = expansion.Add(point, Normalize(solid.corners[i]), radius);
    }
    for (const auto& face : solid.faces) {
      expansion.AddTriangle(made[face[0]], made[face[1]], made[face[2]]);
    }
  }
  *primitive = expansion.Take();
}

void MakeTubes(const std::vector<std::pair<uint32_t, uint32_t>>& segments, float radius,
               Primitive* primitive) {
  Expansion expansion(*primitive);
  const std::vector<Vec3f>& positions = primitive->mesh.positions;
  const size_t sides = segments.size() <= kRoundMax ? 6 : 3;
  std::vector<uint32_t> at_first(sides), at_second(sides);
  for (const auto& [first, second] : segments) {
    const Vec3f along = positions[second] - positions[first];
    const float length = Length(along);
    if (!(length > 0) || !std::isfinite(length)) continue;
    const sheaf::Frame frame = sheaf::Frame::FromNormal(along * (1 / length));
    for (size_t i = 0; i < sides; ++i) {
      const auto turn =
          SinCos(static_cast<float>(2 * kPi) * static_cast<float>(i) / static_cast<float>(sides));
      const Vec3f normal = turn.cos * frame.t + turn.sin * frame.b;
      at_first[i] = expansion.Add(first, normal, radius);
      at_second[i] = expansion.Add(second, normal, radius);
    }
    for (size_t i = 0; i < sides; ++i) {
      const size_t next = (i + 1) % sides;
      expansion.AddTriangle(at_first[i], at_first[next], at_second[i]);
      expansion.AddTriangle(at_first[next], at_second[next], at_second[i]);
    }
  }
  *primitive = expansion.Take();
}

}  // namespace sheaf::gltf
