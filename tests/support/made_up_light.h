// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Guiding fields that tests train on made-up light.
#pragma once

#include <array>
#include <cstdint>

#include "common/math/elementary.h"
#include "tests/support/chi_square.h"
#include "worker/render/guiding/guiding_statistics.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {

inline Vec3f DirectionOf(double s, double t) { return ToFloat(EqualAreaSquareToSphere({s, t})); }

inline Bounds BoxOf(double scale = 1) {
  Bounds box;
  box.Add(Vec3d{-1, -1, -1} * scale);
  box.Add(Vec3d{1, 1, 1} * scale);
  return box;
}

// A value that a path finds at p in the direction w.
struct Found {
  Vec3f p, w;
  double value;
};
// Draw i of light(p, w): p is even over BoxOf(), w over the sphere.
template <typename Light>
Found FindLight(const Light& light, uint64_t i) {
  const std::array<float, 3> u = sheaf::testing::CounterUniforms(1, i);
  const std::array<float, 3> v = sheaf::testing::CounterUniforms(2, i);
  const Vec3f p{2 * u[0] - 1, 2 * u[1] - 1, 2 * u[2] - 1};
  const Vec3f w = DirectionOf(static_cast<double>(v[0]), static_cast<double>(v[1]));
  return {p, w, light(p, w) * 4 * kPi};
}

// The same as a path reports it.
inline FoundLight Reported(Vec3f p, Vec3f w, double value) {
  return {.from = {p}, .w = w, .scattered = value, .radiance = value, .pdf = 1};
}
inline FoundLight Reported(const Found& found) { return Reported(found.p, found.w, found.value); }

// A field refined by 2^k count values in iteration k.
template <typename Light>
GuidingField Train(const Light& light, int iterations, uint64_t count) {
  GuidingField field(BoxOf());
  uint64_t i = 0;
  for (int k = 0; k < iterations; ++k) {
    GuidingStatistics statistics(field, -20);
    for (uint64_t n = 0; n < count << k; ++n) {
      const Found found = FindLight(light, i++);
      statistics.Add(Reported(found));
    }
    GuidingField next = Refine(field, statistics, k);
    field = next;
  }
  return field;
}

// A dim sky and a bright source of radius 0.1 in the direction (0.6, 0, 0.8).
inline constexpr Vec3f kSource{0.6f, 0, 0.8f};
inline double SkyAndSource(Vec3f /*p*/, Vec3f w) {
  return Dot(w, kSource) > 0.995f ? 100 : (w.z > 0 ? 0.5 : 0.25);
}

}  // namespace sheaf::render
