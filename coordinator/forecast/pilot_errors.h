// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Errors of cells from the few blocks that a pilot has (pilot_model.h), most cells without any.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "common/film/error/error_estimate.h"
#include "coordinator/core/cell_grid.h"

namespace sheaf::coordinator {

struct PilotBlock {
  size_t cell = 0;  // That its middle lies in.
  ErrorSums error;
};

struct PilotErrors {
  std::vector<double> of_cells;  // Squared and relative, of a pixel of each, on average.
  // Mean square of a pixel's error over the square of its cell's mean.
  double square_ratio = 1;
};

// The cells have the mean of all blocks, and what rounds save by giving samples where they are
// needed depends on how unequal they are. So where little is known of a cell it does not get the
// mean of all, nor its tile's, but is drawn from what it may be. Requires: blocks with pixels.
PilotErrors FitCellErrors(const CellGrid& grid, std::span<const PilotBlock> blocks);

}  // namespace sheaf::coordinator
