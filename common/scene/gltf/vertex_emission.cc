// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/vertex_emission.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"

namespace sheaf::gltf {
namespace {

using Corners = std::array<Rgb, 3>;

struct LessCorners {
  bool operator()(const Corners& a, const Corners& b) const {
    for (size_t i = 0; i < a.size(); ++i) {
      for (size_t c = 0; c < 3; ++c) {
        if (a[i][c] != b[i][c]) return a[i][c] < b[i][c];
      }
    }
    return false;
  }
};

Corners ColorsOf(const TriangleMesh& mesh, size_t triangle) {
  Corners corners;
  for (size_t i = 0; i < 3; ++i) {
    const VertexColor& color = mesh.colors[mesh.indices[3 * triangle + i]];
    corners[i] = {color[0], color[1], color[2]};
  }
  return corners;
}

// Each element once for each corner of a triangle. width: elements of a vertex.
template <typename T>
void Separate(const std::vector<uint32_t>& indices, size_t width, std::vector<T>* values) {
  if (values->empty()) return;
  std::vector<T> separate;
  separate.reserve(indices.size() * width);
  for (const uint32_t index : indices) {
    for (size_t k = 0; k < width; ++k) separate.push_back((*values)[index * width + k]);
  }
  *values = std::move(separate);
}

void SeparateVertices(Primitive* primitive) {
  TriangleMesh& mesh = primitive->mesh;
  const std::vector<uint32_t>& indices = mesh.indices;
  Separate(indices, 1, &mesh.positions);
  Separate(indices, 1, &mesh.normals);
  Separate(indices, 1, &mesh.tangents);
  Separate(indices, 1, &mesh.colors);
  for (Primitive::Target& target : primitive->targets) {
    Separate(indices, 1, &target.positions);
    Separate(indices, 1, &target.normals);
  }
  Separate(indices, primitive->influences, &primitive->joints);
  Separate(indices, primitive->influences, &primitive->weights);
  for (size_t i = 0; i < mesh.indices.size(); ++i) mesh.indices[i] = static_cast<uint32_t>(i);
}

}  // namespace

std::string SeparateColors(Primitive* primitive) {
  TriangleMesh& mesh = primitive->mesh;
  std::map<Corners, size_t, LessCorners> square_of;
  std::vector<size_t> squares(mesh.indices.size() / 3);
  for (size_t t = 0; t < squares.size(); ++t) {
    squares[t] = square_of.try_emplace(ColorsOf(mesh, t), square_of.size()).first->second;
    if (square_of.size() > kEmissionSquaresMax) return "";
  }
  size_t columns = 1;
  while (columns * columns < square_of.size()) ++columns;
  const size_t rows = (square_of.size() + columns - 1) / columns;
  const size_t width = 2 * columns, height = 2 * rows;
  std::vector<Rgb> texels(width * height);
  for (const auto& [corners, square] : square_of) {
    Rgb* const at = &texels[2 * (square / columns) * width + 2 * (square % columns)];
    at[0] = corners[0];
    at[1] = corners[1];
    at[width] = corners[2];
    // Beyond the triangle, where it is not black: what makes the square a linear function.
    for (size_t c = 0; c < 3; ++c) {
      at[width + 1][c] = std::max(corners[1][c] + corners[2][c] - corners[0][c], 0.0f);
    }
  }
  SeparateVertices(primitive);
  mesh.uvs.resize(mesh.positions.size());
  for (size_t i = 0; i < mesh.uvs.size(); ++i) {
    const size_t square = squares[i / 3];
    const size_t x = 2 * (square % columns) + (i % 3 == 1 ? 1 : 0);
    const size_t y = 2 * (square / columns) + (i % 3 == 2 ? 1 : 0);
    mesh.uvs[i] = {(static_cast<float>(x) + 0.5f) / static_cast<float>(width),
                   (static_cast<float>(y) + 0.5f) / static_cast<float>(height)};
  }
  // Little-endian where the scale is negative; rows from the lowest v upwards.
  std::string bytes = absl::StrCat("PF\n", width, " ", height, "\n-1.0\n");
  for (const Rgb& texel : texels) {
    const std::array<float, 3> numbers = {texel.r, texel.g, texel.b};
    bytes.append(reinterpret_cast<const char*>(numbers.data()), sizeof numbers);
  }
  return bytes;
}

}  // namespace sheaf::gltf
