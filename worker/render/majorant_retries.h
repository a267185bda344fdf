// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RetryWithMajorants: renders a block, and again with higher bounds of densities where they were
// exceeded, so that the block's samples are unbiased.
#pragma once

#include <cstdint>

#include "worker/render/integrator/ray_counts.h"

namespace sheaf::render {

// Beyond this factor, bounds that are still violated are kept, and reported.
inline constexpr float kMajorantFactorMax = 1 << 12;

// Calls render() with counts->majorant_factor from `factor` on, doubled each time, until no density
// was above its bound, or render returned false. Returns how often it was called again.
template <typename Render>
uint32_t RetryWithMajorants(float factor, RayCounts* counts, const Render& render) {
  for (uint32_t retries = 0;; factor *= 2, ++retries) {
    counts->broken_majorants = 0;
    counts->majorant_factor = factor;
    const bool done = !render() || counts->broken_majorants == 0 || factor >= kMajorantFactorMax;
    if (done) return retries;
  }
}

}  // namespace sheaf::render
