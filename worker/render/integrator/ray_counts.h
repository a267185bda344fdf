// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RayCounts: what tracing counts beside the picture, and what it does differently for what it
// counted before.
#pragma once

#include <algorithm>
#include <cstdint>

namespace sheaf::render {

struct RayCounts {
  uint64_t rays = 0;  // All.
  uint64_t shadow_rays = 0;
  // Times that surfaces did not enclose media as they say. Paths and shadow rays ended where a
  // medium has no end and should have one, where matter was left that had not been entered, and
  // where kMediaAtOnceMax were entered and another one. They went on where a MediumInterface
  // contradicts what they were in: MeetSides.
  uint64_t broken_nestings = 0;
  uint32_t broken_shape = ~0u;  // The first of the file that did so; ~0u: none is known.
  void CountBroken(int32_t shape) {
    ++broken_nestings;
    broken_shape = std::min(broken_shape, static_cast<uint32_t>(shape));
  }
  // Densities beyond what they had been found to be at most: none, or the picture is biased.
  uint64_t broken_majorants = 0;
  // What bounds of densities are multiplied by: not 1 where a block is rendered again for
  // broken_majorants.
  float majorant_factor = 1;
  uint64_t long_walks = 0;  // Paths that ended for kMatterStepsMax.
};

}  // namespace sheaf::render
