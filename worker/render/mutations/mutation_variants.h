// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The compiled variants of the integrator for frames whose bright samples start chains of
// mutations, and what they give to the film.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "common/film/film_tile.h"
#include "worker/render/integrator/ray_counts.h"
#include "worker/render/sampling/mutated_sampler.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

class CompiledScene;

// The edge of the regions whose means say which samples are bright.
inline constexpr int32_t kRegionSizePx = 32;
// A sample starts chains with what it has above this multiple of its region's mean. By Markov's
// inequality at most 1 of 32 samples does, so chains of 64 states at most triple the samples, up to
// the error of the means.
inline constexpr double kBrightOverMean = 32;
// The most chains of a sample. Up to it, each state brings no more than the threshold.
inline constexpr uint32_t kChainsPerSampleMax = 16;

// Which samples start chains, and of how many states; fixed for the frame.
struct ChainRules {
  uint32_t states = kChainStatesMax;  // From 1 on, the sample included.
  // Luminances by region, row by row: what a sample has above its region's starts chains. Infinite:
  // no sample does.
  std::vector<double> thresholds;
  int32_t regions_in_row = 0;

  double ThresholdAt(int32_t x, int32_t y) const {
    if (thresholds.empty()) return std::numeric_limits<double>::infinity();
    return thresholds[static_cast<size_t>(y / kRegionSizePx * regions_in_row + x / kRegionSizePx)];
  }
};

class MutationSink {
 public:
  virtual ~MutationSink() = default;
  // The sample of a pixel, less what its chains deposit elsewhere. Called once for each pixel.
  virtual void Add(int32_t x, int32_t y, const FilmSample& sample) = 0;
  // Radiance times filter weight that a chain brings to the pixel.
  virtual void Deposit(int32_t x, int32_t y, const std::array<double, 3>& weighted) = 0;
};

// Traces sample `pass` of every step-th pixel of row y, from column 0 on, and their chains. seed:
// of the samples.
using MutationRowFunction = void (*)(const CompiledScene& scene, const ChainRules& rules,
                                     uint64_t seed, int32_t step, int32_t y, uint64_t pass,
                                     MutationSink* sink, RayCounts* counts);
// variant: an index in AllMutationVariants().
MutationRowFunction MutationRowFunctionOf(size_t variant);

// Defined once for each variant, in generated files.
template <TraitBits kTraits>
void TraceMutationRow(const CompiledScene& scene, const ChainRules& rules, uint64_t seed,
                      int32_t step, int32_t y, uint64_t pass, MutationSink* sink,
                      RayCounts* counts);

}  // namespace sheaf::render
