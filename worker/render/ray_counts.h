// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RayCounts: what tracing counts beside the picture, and what it does differently for what it
// counted before.
#pragma once

#include <cstdint>

namespace sheaf::render {

struct RayCounts {
  uint64_t rays = 0;  // All.
  uint64_t shadow_rays = 0;
  // Paths that ended, and shadow rays that were given up, because surfaces do not enclose media as
  // they say: a medium was left that had not been entered, or has no end where it should have one,
  // or kMediaAtOnceMax are entered and another one.
  uint64_t broken_nestings = 0;
  // Densities beyond what they had been found to be at most: none, or the picture is biased.
  uint64_t broken_majorants = 0;
  // What bounds of densities are multiplied by: not 1 where a block is rendered again for
  // broken_majorants.
  float majorant_factor = 1;
  uint64_t long_walks = 0;  // Paths that ended for kMatterStepsMax.
};

}  // namespace sheaf::render
