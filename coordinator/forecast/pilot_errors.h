// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Estimates the errors of all cells from the few blocks of a pilot (pilot_model.h); most cells
// contain no block.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "common/film/error/error_estimate.h"
#include "coordinator/core/job/cell_grid.h"

namespace sheaf::coordinator {

struct PilotBlock {
  size_t cell = 0;  // The cell that contains the block's center.
  ErrorSums error;
};

struct PilotErrors {
  std::vector<double> of_cells;  // Mean relative squared error of a pixel, by cell.
  // Mean square of a pixel's error over the square of its cell's mean error.
  double square_ratio = 1;
};

// Estimates the errors of cells, scaled so that their mean is the mean over all blocks. The savings
// of rounds, which give more samples to cells with larger errors, depend on how unequal the errors
// are. So a cell with few blocks is not assigned the mean of all cells or of its tile, but a draw
// from the distribution of its possible errors. If no block has an error, no cell has one.
// Requires: blocks with pixels.
PilotErrors FitCellErrors(const CellGrid& grid, std::span<const PilotBlock> blocks);

// Relative deviation of the mean error over all pixels: that of a ratio over blocks of unequal
// sizes. Source: Cochran 1977, Sampling Techniques, sec. 9A.2.
double LogDeviationOf(std::span<const PilotBlock> blocks);

}  // namespace sheaf::coordinator
