// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Globe: a closed mesh of well-shaped or needle-shaped triangles.
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "common/math/vec.h"

namespace sheaf::render {

struct Triangles {
  std::vector<Vec3f> positions;
  std::vector<uint32_t> indices;
};
// A closed sphere of triangles about `center` with outward front faces.
inline Triangles Globe(Vec3d center, int rings, int sectors) {
  Triangles globe;
  const auto vertex = [&](int ring, int sector) -> uint32_t {
    if (ring == 0) return 0;
    if (ring == rings) return 1;
    return static_cast<uint32_t>(2 + (ring - 1) * sectors + sector % sectors);
  };
  globe.positions = {ToFloat(center + Vec3d{0, 0, 1}), ToFloat(center + Vec3d{0, 0, -1})};
  for (int r = 1; r < rings; ++r) {
    for (int s = 0; s < sectors; ++s) {
      const double theta = std::numbers::pi * r / rings, phi = 2 * std::numbers::pi * s / sectors;
      globe.positions.push_back(
          ToFloat(center + Vec3d{std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi),
                                 std::cos(theta)}));
    }
  }
  for (int r = 0; r < rings; ++r) {
    for (int s = 0; s < sectors; ++s) {
      const uint32_t a = vertex(r, s), b = vertex(r + 1, s), c = vertex(r + 1, s + 1),
                     d = vertex(r, s + 1);
      if (r + 1 < rings) globe.indices.insert(globe.indices.end(), {a, b, c});
      if (r > 0) globe.indices.insert(globe.indices.end(), {a, c, d});
    }
  }
  return globe;
}

}  // namespace sheaf::render
