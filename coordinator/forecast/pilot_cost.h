// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The cost of a sample of a frame, from the CPU time of a pilot's images.
#pragma once

#include <span>
#include <vector>

#include "coordinator/forecast/pilot_model.h"

namespace sheaf::coordinator {

// The time of a sample of sparse blocks over that of one of an image, for which neighbors have
// filled the caches: the median of eight scenes; 1 to 20 % more by scene.
inline constexpr double kSparseCost = 1.06, kSparseLogDeviation = 0.06;

struct CpuModel {
  std::vector<double> seconds;  // For one sample of a pixel, by cell.
  double log_deviation = 0;     // The frame's cost, for the choice of blocks and kSparseCost.
};

// By images of lattices alone: the small one comes first, and threads take longer in their first
// milliseconds, with cold caches. errors: relMSE of each cell, as far as it is known. Requires: as
// FitErrorModel.
CpuModel FitCpu(const CellGrid& grid, std::span<const PilotImage> pilot,
                std::span<const double> errors);

}  // namespace sheaf::coordinator
