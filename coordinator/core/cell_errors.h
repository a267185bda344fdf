// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The errors of a frame's cells, for sharing samples among them (sample_rounds.h).
#pragma once

#include <vector>

#include "common/film/error/error_estimate.h"
#include "common/film/frame_image.h"
#include "coordinator/core/cell_grid.h"

namespace sheaf::coordinator {

// EstimateTileErrors of the grid's cells, where those that few pixels tell lean on their tiles.
//
// The error of a cell is known the better, the more of its pixels contribute to it. Where one of 64
// has most of it, because of a bright sample that any other cell of the tile might have met, it
// says little of the cell's next samples. So a cell's error is drawn to its tile's, with the weight
// kLeanPixels / (kLeanPixels + m), m = sum^2 / sum of squares: the number of equal pixels that
// would vary as much. Sums over tiles do not change.
// Source: Efron and Morris 1973, "Stein's Estimation Rule and Its Competitors"; m is Kish's
// effective size (Kish 1965, Survey Sampling).
inline constexpr double kLeanPixels = 2;
std::vector<ErrorSums> EstimateCellErrors(const FrameImage& image, const CellGrid& grid);
// The leaning alone. Requires: errors of all cells.
void LeanOnTiles(const CellGrid& grid, std::vector<ErrorSums>* errors);

}  // namespace sheaf::coordinator
