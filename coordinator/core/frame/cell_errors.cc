// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/cell_errors.h"

#include <span>

#include "common/film/error/eye_errors.h"

namespace sheaf::coordinator {
namespace {

// Adjusts the cells' values to the sum `total`: scales them down if their sum is larger, otherwise
// distributes the difference evenly over all pixels.
template <typename ValueOf>
void RestoreTotal(std::span<ErrorSums> cells, double total, const ValueOf& value_of) {
  double sum = 0, pixel_count = 0;
  for (ErrorSums& cell : cells) {
    sum += value_of(cell);
    pixel_count += static_cast<double>(cell.pixel_count);
  }
  for (ErrorSums& cell : cells) {
    if (sum > total) {
      value_of(cell) *= total / sum;
    } else {
      value_of(cell) += (total - sum) * static_cast<double>(cell.pixel_count) / pixel_count;
    }
  }
}

void LeanOnMean(std::span<ErrorSums> cells) {
  ErrorSums tile;
  for (const ErrorSums& cell : cells) tile.Add(cell);
  if (!(tile.sum > 0)) return;
  for (ErrorSums& cell : cells) {
    const double fraction =
        static_cast<double>(cell.pixel_count) / static_cast<double>(tile.pixel_count);
    const double pixels = cell.square_sum > 0 ? cell.sum * cell.sum / cell.square_sum : 0;
    const double weight = pixels / (pixels + kLeanPixels);
    cell.sum = weight * cell.sum + (1 - weight) * fraction * tile.sum;
    cell.square_sum = weight * cell.square_sum + (1 - weight) * fraction * tile.square_sum;
  }
  RestoreTotal(cells, tile.sum, [](ErrorSums& cell) -> double& { return cell.sum; });
  RestoreTotal(cells, tile.square_sum, [](ErrorSums& cell) -> double& { return cell.square_sum; });
}

}  // namespace

void LeanOnTiles(const CellGrid& grid, std::vector<ErrorSums>* errors) {
  const std::span<ErrorSums> all(*errors);
  for (uint32_t tile = 0; tile < grid.tiles().size(); ++tile) {
    if (grid.cell_count(tile) == 1) continue;
    LeanOnMean(all.subspan(grid.first_cell(tile), grid.cell_count(tile)));
  }
}

std::vector<ErrorSums> EstimateCellErrors(const FrameImage& image, const CellGrid& grid) {
  if (HasEyeDifference(image)) return {EstimateEyeErrors(image).OfWorse()};
  std::vector<ErrorSums> errors = EstimateTileErrors(image, grid.cells());
  LeanOnTiles(grid, &errors);
  return errors;
}

}  // namespace sheaf::coordinator
