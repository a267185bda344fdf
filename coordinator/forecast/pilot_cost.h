// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What a sample of a frame costs, from what a pilot's pictures took.
#pragma once

#include <span>
#include <vector>

#include "coordinator/forecast/pilot_model.h"

namespace sheaf::coordinator {

// What a sample of sparse blocks takes of the time of one of a picture, whose neighbours have
// brought what it needs into the caches, in the median of eight scenes; 1 to 20 % more by scene.
inline constexpr double kSparseCost = 1.06, kSparseLogDeviation = 0.06;

struct CpuModel {
  std::vector<double> seconds;  // Of one sample of a pixel, in each cell.
  double log_deviation = 0;     // Of the frame's, for the choice of blocks and kSparseCost.
};

// By pictures of lattices alone: the small one comes first, and threads take longer in their first
// milliseconds, with cold caches. errors: relMSE of each cell, as far as it is known. Requires: as
// FitErrorModel.
CpuModel FitCpu(const CellGrid& grid, std::span<const PilotPicture> pilot,
                std::span<const double> errors);

}  // namespace sheaf::coordinator
