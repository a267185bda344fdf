// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The errors of a frame's cells, for sharing samples among them (sample_rounds.h).
#pragma once

#include <vector>

#include "common/film/error/error_estimate.h"
#include "common/film/frame_image.h"
#include "coordinator/core/job/cell_grid.h"

namespace sheaf::coordinator {

// Estimates the errors of the grid's cells as EstimateTileErrors does for tiles, and then draws the
// errors of cells that depend on few pixels toward the mean of their tile.
//
// The more pixels contribute to a cell's error, the more reliable the estimate is. If one of 64
// pixels has most of the error, because of a bright sample that any other cell of the tile might
// have met, the error says little about the cell's next samples. So a cell's error is drawn toward
// its tile's with the weight kLeanPixels / (kLeanPixels + m), where m = sum^2 / sum of squares is
// the number of equal pixels with the same variance. Sums over tiles do not change. Source: Efron
// and Morris 1973, "Stein's Estimation Rule and Its Competitors"; m is Kish's effective size (Kish
// 1965, Survey Sampling).
inline constexpr double kLeanPixels = 2;
std::vector<ErrorSums> EstimateCellErrors(const FrameImage& image, const CellGrid& grid);
// Draws the given errors of all cells toward those of their tiles. Requires: errors of all cells.
void LeanOnTiles(const CellGrid& grid, std::vector<ErrorSums>* errors);

}  // namespace sheaf::coordinator
