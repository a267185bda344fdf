// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WeightOf: the weights of the techniques that find a path, by the power heuristic with exponent 2
// over their densities. All weights of the renderer come from here. Source: Veach 1997, sec. 9.2.4.
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstdint>

namespace sheaf::render {

// The techniques by which a path finds the light at its end.
enum class FindsBy : uint8_t {
  kHit,          // The ray that the last vertex scatters hits the light.
  kLightSample,  // The light is sampled from the last vertex.
  kLine,         // The light is sampled for the segment that leads to the last vertex.
  kLightPath,    // The path begins at the light and is connected to the lens.
  kMerge,        // The path begins at the light and is merged with one from the lens.
};

// The weight in [0, 1] of a path that its own technique finds with density `own`, and one each of
// other techniques with the other densities. Only their ratios matter, so one of them may be 1 and
// the others be over it; they are computed from the largest, so that no square overflows or
// underflows. The weights of all techniques sum to 1. Requires: densities >= 0. If all are 0, or
// several are infinite, those weights are equal.
template <std::floating_point T, std::same_as<T>... Others>
T WeightOf(T own, Others... others) {
  static_assert(sizeof...(others) > 0);
  const T largest = std::max({own, others...});
  if (!(largest > 0)) return T{1} / static_cast<T>(1 + sizeof...(others));
  const auto square = [largest](T density) {
    const T part = std::isinf(largest) ? (std::isinf(density) ? T{1} : T{0}) : density / largest;
    return part * part;
  };
  return square(own) / (square(own) + ... + square(others));
}

// The same value with one division less.
inline float WeightOf(float own, float other) {
  if (own == other) return 0.5f;
  if (own > other) {
    const float ratio = other / own;
    return 1 / (1 + ratio * ratio);
  }
  const float ratio = own / other;
  return ratio * ratio / (1 + ratio * ratio);
}

}  // namespace sheaf::render
