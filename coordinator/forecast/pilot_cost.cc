// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/pilot_cost.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>

#include "common/base/check.h"

namespace sheaf::coordinator {
namespace {

// Prior of the CPU seconds that a pixel costs without samples, for the film, and its deviation.
constexpr double kIdleSeconds = 5e-8, kIdleDeviation = 3e-8;
// The weight, in blocks, of the frame's mean cost in the estimate of a tile's cost. It is small, as
// costs differ more between tiles than within a tile.
constexpr double kCostBlocks = 0.4;
// The weight, in squared logarithms of errors, of the prior that costs do not depend on errors; and
// the smallest error of a tile, for its logarithm.
constexpr double kSlopeSquares = 5, kErrorMin = 1e-30;

// Pixels, samples and CPU time of images.
struct Cost {
  double pixel_count = 0, samples = 0, cpu_seconds = 0;
};

// Estimates the CPU seconds per pixel that do not depend on its samples from single images of
// lattices: the slope of the CPU time per sample over the number of pixels per sample, which
// differs between tiles. The estimate is drawn toward the prior, as tiles also differ for other
// reasons. Source: Draper and Smith 1998, Applied Regression Analysis, chapters 1 and 9.
double IdleCostOfTiles(std::span<const PixelRect> tiles, std::span<const PilotImage> pilot) {
  struct Point {
    double weight, x, y;  // Samples; pixels per sample; seconds per sample.
  };
  std::vector<Point> points;
  double weight = 0, x_mean = 0, y_mean = 0;
  for (const PilotImage& image : pilot) {
    const PilotLevel& level = image.level;
    if (level.lattice.All()) continue;
    for (size_t i = 0; i < tiles.size(); ++i) {
      const auto samples =
          static_cast<double>(level.lattice.SampleCountIn(tiles[i], level.samples));
      if (samples == 0) continue;
      points.push_back({samples, static_cast<double>(tiles[i].PixelCount()) / samples,
                        image.cpu_seconds_of_tiles[i] / samples});
      weight += samples;
      x_mean += samples * points.back().x;
      y_mean += samples * points.back().y;
    }
  }
  if (points.size() < 3) return kIdleSeconds;
  x_mean /= weight;
  y_mean /= weight;
  double xx = 0, xy = 0, yy = 0;
  for (const Point& point : points) {
    const double dx = point.x - x_mean, dy = point.y - y_mean;
    xx += point.weight * dx * dx;
    xy += point.weight * dx * dy;
    yy += point.weight * dy * dy;
  }
  if (!(xx > 0)) return kIdleSeconds;
  const double slope = xy / xx;
  const double residual =
      std::max(yy - slope * xy, 1e-6 * yy) / static_cast<double>(points.size() - 2);
  const double precision = xx / residual, prior = 1 / (kIdleDeviation * kIdleDeviation);
  return std::max(0.0, (slope * precision + kIdleSeconds * prior) / (precision + prior));
}

// Estimates the CPU seconds that each pixel costs, with or without samples, for the film and for
// the overhead of parts. They matter little in an image, but much in a pilot. The two images of a
// pair have the same overhead, so they determine it best.
double FitIdleCost(std::span<const PixelRect> tiles, std::span<const PilotImage> pilot) {
  std::map<int32_t, std::map<uint64_t, Cost>> levels;  // By stride and samples.
  for (const PilotImage& image : pilot) {
    const PilotLevel& level = image.level;
    if (level.lattice.All()) continue;
    Cost& cost = levels[level.lattice.stride_px][level.samples];
    cost.pixel_count = static_cast<double>(image.image.window.PixelCount());
    cost.samples =
        static_cast<double>(level.lattice.SampleCountIn(image.image.window, level.samples));
    for (const double seconds : image.cpu_seconds_of_tiles) cost.cpu_seconds += seconds;
  }
  double idle_seconds = 0, pixel_count = 0;
  for (const auto& [stride, pair] : levels) {
    if (pair.size() < 2) continue;
    const Cost& low = pair.begin()->second;
    const Cost& high = pair.rbegin()->second;
    const double per_sample = (high.cpu_seconds - low.cpu_seconds) / (high.samples - low.samples);
    idle_seconds += low.cpu_seconds - std::max(0.0, per_sample) * low.samples;
    pixel_count += low.pixel_count;
  }
  return pixel_count == 0 ? IdleCostOfTiles(tiles, pilot)
                          : std::max(0.0, idle_seconds) / pixel_count;
}

// Distributes the mean cost of a sample in each tile, which pilots measure, among the tile's cells.
// If tiles with larger errors are slower, for example those that contain smoke, so are cells: the
// cost is taken to be a power of the error. The exponent follows from a regression over tiles and
// is drawn toward 0 if tiles tell little. Source: Draper and Smith 1998, Applied Regression
// Analysis, chapter 1.
std::vector<double> CpuOfCells(const CellGrid& grid, std::span<const double> seconds_of_tiles,
                               std::span<const double> errors) {
  const auto tile_count = static_cast<uint32_t>(grid.tiles().size());
  std::vector<double> log_errors, log_seconds;
  for (uint32_t tile = 0; tile < tile_count; ++tile) {
    double sum = 0;
    for (uint32_t i = 0; i < grid.cell_count(tile); ++i) {
      sum += errors[grid.first_cell(tile) + i];
    }
    log_errors.push_back(std::log(std::max(sum / grid.cell_count(tile), kErrorMin)));
    log_seconds.push_back(std::log(seconds_of_tiles[tile]));
  }
  const auto mean_of = [](const std::vector<double>& values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
  };
  const double mean_error = mean_of(log_errors), mean_seconds = mean_of(log_seconds);
  double product = 0, squares = kSlopeSquares;
  for (uint32_t tile = 0; tile < tile_count; ++tile) {
    product += (log_errors[tile] - mean_error) * (log_seconds[tile] - mean_seconds);
    squares += (log_errors[tile] - mean_error) * (log_errors[tile] - mean_error);
  }
  const double power = product / squares;
  std::vector<double> of_tiles, weights;  // Sums over all pixels.
  for (uint32_t tile = 0; tile < tile_count; ++tile) {
    of_tiles.push_back(seconds_of_tiles[tile] *
                       static_cast<double>(grid.tiles()[tile].PixelCount()));
  }
  const std::vector<PixelRect>& cells = grid.cells();
  for (size_t i = 0; i < cells.size(); ++i) {
    weights.push_back(static_cast<double>(cells[i].PixelCount()) *
                      std::pow(std::max(errors[i], kErrorMin), power));
  }
  std::vector<double> seconds = grid.Distribute(of_tiles, weights);
  for (size_t i = 0; i < cells.size(); ++i) {
    seconds[i] /= static_cast<double>(cells[i].PixelCount());
  }
  return seconds;
}

}  // namespace

CpuModel FitCpu(const CellGrid& grid, std::span<const PilotImage> pilot,
                std::span<const double> errors) {
  const std::vector<PixelRect>& tiles = grid.tiles();
  const double idle = FitIdleCost(tiles, pilot);
  std::vector<Cost> of_tile(tiles.size());
  Cost all;
  for (const PilotImage& image : pilot) {
    const PilotLevel& level = image.level;
    if (level.lattice.All()) continue;
    SHEAF_CHECK(image.cpu_seconds_of_tiles.size() == tiles.size());
    for (size_t i = 0; i < tiles.size(); ++i) {
      const auto samples =
          static_cast<double>(level.lattice.SampleCountIn(tiles[i], level.samples));
      if (samples == 0) continue;
      const double taken = image.cpu_seconds_of_tiles[i];
      const double seconds =
          std::max(taken / 2, taken - idle * static_cast<double>(tiles[i].PixelCount()));
      for (Cost* cost : {&of_tile[i], &all}) {
        cost->samples += samples;
        cost->cpu_seconds += seconds;
      }
    }
  }
  const double mean = all.cpu_seconds / all.samples;
  constexpr PixelLattice block{kPixelStrideMin};
  const double known =
      kCostBlocks * block.SamplesPerPixel(kPilotSamples) * block.stride_px * block.stride_px;
  double squares = 0;
  std::vector<double> seconds;  // By tile.
  for (const Cost& cost : of_tile) {
    const double own = (cost.cpu_seconds + known * mean) / (cost.samples + known);
    seconds.push_back(std::max(own, 0.01 * mean));
    squares += (cost.cpu_seconds - mean * cost.samples) * (cost.cpu_seconds - mean * cost.samples);
  }
  CpuModel model;
  model.seconds = CpuOfCells(grid, seconds, errors);
  for (double& of_cell : model.seconds) of_cell /= kSparseCost;
  model.log_deviation = std::hypot(std::sqrt(squares) / all.cpu_seconds, kSparseLogDeviation);
  return model;
}

}  // namespace sheaf::coordinator
