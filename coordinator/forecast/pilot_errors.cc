// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/pilot_errors.h"

#include <algorithm>
#include <cmath>

#include "common/math/golden_sequence.h"
#include "common/math/normal_distribution.h"

namespace sheaf::coordinator {
namespace {

// Prior variance of the logarithms of blocks' errors, and the weight of this prior and of
// WithinFraction in blocks.
constexpr double kBlockLogVariance = 1.4, kVarianceFreedom = 10;
// Prior of the fraction of that variance within squares of this size: .04 to .5 for 8 pixels, .14
// to .61 for 16, .31 to .74 for 32 (eight scenes).
double WithinFraction(int32_t size_px) {
  return std::min(0.8, 0.55 * std::pow(size_px / 32.0, 0.57));
}
// A block's error counts as at least this fraction of the mean error.
constexpr double kPilotCellFractionMin = 0.05;

// Prior of the squared relative deviation of blocks from their mean, and its weight in blocks. If
// few pixels have most of the error, a few blocks may contain none of them.
constexpr double kTailSquare = 2.5 * 2.5, kTailBlocks = 10;

// The i-th value of a sequence of which any number of values are normally distributed.
double NormalValue(size_t i) { return NormalQuantile(GoldenFraction(i)); }

// Sums of the logarithms of blocks' errors.
struct LogSums {
  double count = 0, sum = 0, square_sum = 0;
  void Add(double value) {
    ++count;
    sum += value;
    square_sum += value * value;
  }
  double Mean() const { return sum / count; }
  double Squares() const { return count == 0 ? 0 : square_sum - sum * sum / count; }
};

// Variances of logarithms: of blocks in a cell, of cells in a tile, and of tiles.
struct Variances {
  double in_cell = 0, of_cells = 0, of_tiles = 0;
};
// Estimates the components of variance by nested analysis; Searle 1971, Linear Models, chapter 10.
Variances FitVariances(const CellGrid& grid, const std::vector<LogSums>& cells,
                       const std::vector<LogSums>& tiles, const LogSums& all) {
  const double total = (all.Squares() + kVarianceFreedom * kBlockLogVariance) /
                       (std::max(all.count - 1, 0.0) + kVarianceFreedom);
  const auto within = [&](const std::vector<LogSums>& places, int32_t size_px) {
    double squares = kVarianceFreedom * WithinFraction(size_px) * total, freedom = kVarianceFreedom;
    for (const LogSums& place : places) {
      squares += place.Squares();
      freedom += std::max(place.count - 1, 0.0);
    }
    return squares / freedom;
  };
  Variances variances;
  variances.in_cell = within(cells, grid.cell_size_px());
  const double in_tile = std::max(within(tiles, grid.tile_size_px()), variances.in_cell);
  variances.of_cells = in_tile - variances.in_cell;
  variances.of_tiles = std::max(total - in_tile, 0.1 * total);
  return variances;
}

// Logarithms of the cells' errors relative to the mean, up to a constant: the expected values of
// tiles and of cells within them, given their blocks, plus a random draw of the remaining
// uncertainty.
// Source: Henderson 1975, "Best Linear Unbiased Estimation and Prediction under a Selection Model".
std::vector<double> PredictLogs(const CellGrid& grid, const std::vector<LogSums>& cells,
                                const Variances& variances, double mean) {
  std::vector<double> logs;
  for (uint32_t tile = 0; tile < grid.tiles().size(); ++tile) {
    const uint32_t first = grid.first_cell(tile), end = first + grid.cell_count(tile);
    double precision = 1 / variances.of_tiles, sum = 0;
    for (uint32_t i = first; i < end; ++i) {
      if (cells[i].count == 0) continue;
      const double own = 1 / (variances.of_cells + variances.in_cell / cells[i].count);
      precision += own;
      sum += own * (cells[i].Mean() - mean);
    }
    const double of_tile = sum / precision;
    const double drawn = NormalValue(tile) / std::sqrt(precision);
    for (uint32_t i = first; i < end; ++i) {
      const double weight = cells[i].count * variances.of_cells /
                            (cells[i].count * variances.of_cells + variances.in_cell);
      double log = of_tile + drawn + std::sqrt((1 - weight) * variances.of_cells) * NormalValue(i);
      if (cells[i].count > 0) log += weight * (cells[i].Mean() - mean - of_tile);
      logs.push_back(log);
    }
  }
  return logs;
}

}  // namespace

double LogDeviationOf(std::span<const PilotBlock> blocks) {
  ErrorSums all;
  for (const PilotBlock& block : blocks) all.Add(block.error);
  if (blocks.size() < 2 || all.sum <= 0) return 0;
  double squares = 0;
  for (const PilotBlock& block : blocks) {
    const double difference =
        block.error.sum - all.RelativeMse() * static_cast<double>(block.error.pixel_count);
    squares += difference * difference;
  }
  const auto n = static_cast<double>(blocks.size());
  const double relative_square = squares * n / all.sum / all.sum;
  return std::sqrt((n * relative_square + kTailBlocks * kTailSquare) / (n + kTailBlocks) / (n - 1));
}

PilotErrors FitCellErrors(const CellGrid& grid, std::span<const PilotBlock> blocks) {
  const std::vector<PixelRect>& cells = grid.cells();
  ErrorSums all;
  for (const PilotBlock& block : blocks) all.Add(block.error);
  if (all.sum <= 0) return {std::vector<double>(cells.size(), 0), 1};
  const double least = kPilotCellFractionMin * all.RelativeMse();
  std::vector<LogSums> log_cells(cells.size()), log_tiles(grid.tiles().size());
  std::vector<double> pixel_counts(cells.size());  // Pixels of the blocks in each cell.
  LogSums log_all;
  for (const PilotBlock& block : blocks) {
    const double value = std::log(std::max(block.error.RelativeMse(), least));
    log_cells[block.cell].Add(value);
    log_tiles[grid.TileOf(static_cast<uint32_t>(block.cell))].Add(value);
    log_all.Add(value);
    pixel_counts[block.cell] += static_cast<double>(block.error.pixel_count);
  }
  const Variances variances = FitVariances(grid, log_cells, log_tiles, log_all);
  PilotErrors errors;
  double sum = 0, pixel_count = 0;
  for (const double log : PredictLogs(grid, log_cells, variances, log_all.Mean())) {
    const auto pixels = static_cast<double>(cells[errors.of_cells.size()].PixelCount());
    errors.of_cells.push_back(std::exp(log));
    sum += errors.of_cells.back() * pixels;
    pixel_count += pixels;
  }
  double squares = 0;
  for (size_t i = 0; i < cells.size(); ++i) {
    errors.of_cells[i] *= all.RelativeMse() * pixel_count / sum;
    squares += pixel_counts[i] * errors.of_cells[i] * errors.of_cells[i];
  }
  if (squares > 0) errors.square_ratio = std::max(1.0, all.square_sum / squares);
  return errors;
}

}  // namespace sheaf::coordinator
