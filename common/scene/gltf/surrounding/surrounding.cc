// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/gltf/surrounding/surrounding.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "absl/strings/str_cat.h"

namespace sheaf::gltf {
namespace {

constexpr int kMapSizePx = 64;

// The height of the direction at a point of the square. Source: P. Clarberg 2008, "Fast Equal-Area
// Mapping of the (Hemi)Sphere using SIMD": the diamond within the square is the upper hemisphere.
double HeightAt(double s, double t) {
  const double to_diagonal = 1 - (std::fabs(2 * s - 1) + std::fabs(2 * t - 1));
  const double r = 1 - std::fabs(to_diagonal);
  return std::copysign(1 - r * r, to_diagonal);
}

}  // namespace

std::string SurroundingMap() {
  // Little-endian where the scale is negative. The order of the rows is all the same by symmetry.
  std::string bytes = absl::StrCat("PF\n", kMapSizePx, " ", kMapSizePx, "\n-1.0\n");
  for (int row = 0; row < kMapSizePx; ++row) {
    for (int column = 0; column < kMapSizePx; ++column) {
      const double height =
          std::max(HeightAt((column + 0.5) / kMapSizePx, (row + 0.5) / kMapSizePx), 0.0);
      const double radiance =
          kHorizonRadiance + (kZenithRadiance - kHorizonRadiance) * height * height;
      std::array<float, 3> texel;
      texel.fill(static_cast<float>(radiance));
      bytes.append(reinterpret_cast<const char*>(texel.data()), sizeof texel);
    }
  }
  return bytes;
}

Matrix4 WorldFromSurrounding() {
  Matrix4 matrix;
  matrix.m = {{{1, 0, 0, 0}, {0, 0, 1, 0}, {0, -1, 0, 0}, {0, 0, 0, 1}}};
  return matrix;
}

}  // namespace sheaf::gltf
