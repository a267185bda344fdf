// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The errors of a frame's cells, for sharing samples among them (sample_rounds.h).
#pragma once

#include <vector>

#include "common/film/error/error_estimate.h"
#include "common/film/frame_picture.h"
#include "coordinator/core/cell_grid.h"

namespace sheaf::coordinator {

// EstimateTileErrors of the grid's cells, where those that few pixels tell lean on their tiles.
//
// What a cell errs by is known as well as the pixels that make it are many: where one of 64 has
// most of it, a bright sample that any other cell of the tile might have met, it says little of
// what the cell will do next. So its error is drawn to its tile's, by a share of
// kLeanPixels / (kLeanPixels + m), m = sum^2 / sum of squares: the number of equal pixels that
// would vary as much. Sums over tiles stay as they are.
// Source: Efron and Morris 1973, "Stein's Estimation Rule and Its Competitors"; m is Kish's
// effective size (Kish 1965, Survey Sampling).
inline constexpr double kLeanPixels = 2;
std::vector<ErrorSums> EstimateCellErrors(const FramePicture& picture, const CellGrid& grid);
// The leaning alone. Requires: errors of all cells.
void LeanOnTiles(const CellGrid& grid, std::vector<ErrorSums>* errors);

}  // namespace sheaf::coordinator
