// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Estimates the CPU time of a frame's samples from the CPU time of a pilot's images.
#pragma once

#include <span>
#include <vector>

#include "coordinator/forecast/pilot_model.h"

namespace sheaf::coordinator {

// The CPU time of a sample in sparse blocks over that of a sample in a full image, where
// neighboring pixels have filled the caches: the median of eight scenes, which range from 1 to 20 %
// more.
inline constexpr double kSparseCost = 1.06, kSparseLogDeviation = 0.06;

struct CpuModel {
  std::vector<double> seconds;  // For one sample of a pixel, by cell.
  // Deviation of the frame's cost, due to the choice of blocks and to kSparseCost.
  double log_deviation = 0;
};

// Fits the model to images of lattices only. The small image is ignored, as it is rendered first,
// and threads are slower in their first milliseconds, with cold caches. errors: the estimated
// relMSE of each cell. Requires: as for FitErrorModel.
CpuModel FitCpu(const CellGrid& grid, std::span<const PilotImage> pilot,
                std::span<const double> errors);

}  // namespace sheaf::coordinator
