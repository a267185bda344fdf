// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GuidingShares: learns with which probability paths should take a direction from a region of a
// GuidingField, and not from scattering. Each path tells what its contribution would have been
// worth under each of a few probabilities: the second moments of the estimates that they would
// give. The least one wins.
//
// Sums are integers, so neither order nor threads matter. Another way to the same end, by gradient
// descent, depends on the order of the paths: Mueller 2019, "Practical Path Guiding in Production".
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "worker/render/guiding/guiding_field.h"

namespace sheaf::render {

// The choices of a share. One that is not the best of all costs little: moments are flat there.
inline constexpr std::array<float, 5> kGuidingShares{kGuidedShareMin, 0.3f, 0.5f, 0.7f,
                                                     kGuidedShareMax};
// Contributions are squared in units of 2^12 units of the statistics, and squares are at most 2^40:
// 2^24 of them fit in a sum.
inline constexpr double kGuidingShareUnit = 0x1p-12;
inline constexpr double kGuidingSquareMax = 0x1p40;

// Add may be called from many threads; BestOf, after all calls of Add.
class GuidingShares {
 public:
  explicit GuidingShares(size_t region_count);
  // scattered: what a path found, in units (FoundLight::scattered). scattering_part: as there, for
  // a direction that was taken with the share. Requires: finite, >= 0.
  void Add(uint32_t region, float share, double scattered, double scattering_part);
  // `share`, where nothing is known.
  float BestOf(uint32_t region, float share) const;
  uint64_t memory_bytes() const;

 private:
  std::vector<std::array<std::atomic<uint64_t>, kGuidingShares.size()>> moments_;  // [region].
};

}  // namespace sheaf::render
