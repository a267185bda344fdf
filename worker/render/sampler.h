// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sampler: (seed, pixel, sample index, slot) -> point of [0, 1)^4. No state, no order of calls: any
// machine can make any sample. Each of the kReplicateCount replicates (common/film/film_tile.h) has
// its own Owen scramble; within one, points follow Sobol's sequence from its first point on.
// Source: Owen 1995; Burley 2020, "Practical Hash-based Owen Scrambling", JCGT 9(4).
#pragma once

#include <array>
#include <cstdint>

#include "common/math/vec.h"

namespace sheaf::render {

class Sampler {
 public:
  // sample_index is the film's: replicate and index within it follow from it.
  Sampler(uint64_t seed, int32_t pixel_x, int32_t pixel_y, uint64_t sample_index);
  // All four coordinates of a slot. Values are in [0, 1), never 1.
  std::array<float, 4> Get4(uint32_t slot) const;
  Vec2f Get2(uint32_t slot) const;   // The first two.
  float Get1(uint32_t slot) const;   // The first.

 private:
  uint64_t key_ = 0;    // Of seed, pixel and replicate.
  uint64_t index_ = 0;  // Within the replicate.
};

}  // namespace sheaf::render
