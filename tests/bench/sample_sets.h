// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The point sets by which an image is sampled, for measurements of their discrepancy.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "common/film/film_tile.h"
#include "common/math/mix_bits.h"
#include "tests/bench/discrepancy.h"
#include "worker/render/sampling/dimensions.h"
#include "worker/render/sampling/sampler.h"
#include "worker/render/sampling/sobol_points.h"

namespace sheaf::render {

// Chooses the pixel whose points are taken.
struct SetNumber {
  int32_t pixel = 0;
};

inline Sampler SamplerOf(SetNumber set, uint64_t sample) { return {1, set.pixel, 0, sample}; }

// The first D coordinates of a slot, in one replicate.
template <size_t D>
PointSet<D> SlotPoints(SetNumber set, size_t count) {
  PointSet<D> points(count);
  for (size_t i = 0; i < count; ++i) {
    const auto u = SamplerOf(set, i * kReplicateCount).Get4(Slot(0, VertexSlot::kBsdf));
    for (size_t k = 0; k < D; ++k) points[i][k] = static_cast<double>(u[k]);
  }
  return points;
}

// One coordinate of each of two slots, in one replicate.
inline PointSet<2> SlotPairPoints(SetNumber set, size_t count) {
  PointSet<2> points(count);
  for (size_t i = 0; i < count; ++i) {
    const Sampler sampler = SamplerOf(set, i * kReplicateCount);
    points[i] = {static_cast<double>(sampler.Get4(Slot(0, VertexSlot::kBsdf))[0]),
                 static_cast<double>(sampler.Get4(Slot(1, VertexSlot::kLight))[1])};
  }
  return points;
}

// The first samples of a pixel: all replicates in turn.
inline PointSet<2> ReplicatePoints(SetNumber set, size_t count) {
  PointSet<2> points(count);
  for (size_t i = 0; i < count; ++i) {
    const auto u = SamplerOf(set, i).Get4(Slot(0, VertexSlot::kBsdf));
    points[i] = {static_cast<double>(u[0]), static_cast<double>(u[1])};
  }
  return points;
}

// Positions on lights of the light paths of one pass, which are named by pixels.
inline PointSet<2> LightPassPoints(SetNumber set, size_t count) {
  constexpr int32_t kWidthPx = 64;
  PointSet<2> points(count);
  for (size_t i = 0; i < count; ++i) {
    const auto number = static_cast<int32_t>(i);
    const Sampler sampler(1, number % kWidthPx, number / kWidthPx,
                          static_cast<uint64_t>(set.pixel));
    const auto u = sampler.Get2(Slot(CameraSlot::kFilterAndLens));
    points[i] = {static_cast<double>(u.x), static_cast<double>(u.y)};
  }
  return points;
}

// Sobol's sequence without scrambling. The same for every set.
template <size_t D>
PointSet<D> SobolPoints(SetNumber, size_t count) {
  PointSet<D> points(count);
  for (size_t i = 0; i < count; ++i) {
    const SobolPoint point = SobolPointOfReversedIndex(sobol::ReverseBits64(i));
    for (size_t k = 0; k < D; ++k) {
      points[i][k] = static_cast<double>(sobol::UnitFloat(sobol::ReverseBits(point.reversed[k])));
    }
  }
  return points;
}

// Independent numbers.
template <size_t D>
PointSet<D> IndependentPoints(SetNumber set, size_t count) {
  PointSet<D> points(count);
  uint64_t state = MixBits(static_cast<uint64_t>(set.pixel) + 1);
  for (auto& point : points) {
    for (double& x : point) {
      state = MixBits(state + 0x9e3779b97f4a7c15u);
      x = static_cast<double>(state >> 11) * 0x1p-53;
    }
  }
  return points;
}

// The mean of `measure` over several sets of `count` points.
template <typename Make, typename Measure>
double MeanOverSets(const Make& make, const Measure& measure, size_t count, int32_t set_count) {
  double sum = 0;
  for (int32_t i = 0; i < set_count; ++i) sum += measure(make(SetNumber{i}, count));
  return sum / set_count;
}

}  // namespace sheaf::render
