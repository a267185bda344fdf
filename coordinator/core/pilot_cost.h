// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What a sample of a frame costs, from what a pilot's pictures took.
#pragma once

#include <span>
#include <vector>

#include "coordinator/core/pilot_model.h"

namespace sheaf::coordinator {

struct CpuModel {
  std::vector<double> seconds;  // Of one sample of a pixel, in each tile.
  double log_deviation = 0;     // Of the frame's, for the choice of blocks.
};

// By pictures of lattices alone: the small one comes first, and threads take longer in their first
// milliseconds, with cold caches. Requires: as FitErrorModel.
CpuModel FitCpu(std::span<const PixelRect> tiles, std::span<const PilotPicture> pilot);

}  // namespace sheaf::coordinator
