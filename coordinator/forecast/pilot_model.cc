// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/pilot_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <utility>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/base/check.h"
#include "common/film/error/error_planes.h"
#include "coordinator/forecast/pilot_cost.h"
#include "coordinator/forecast/pilot_errors.h"
#include "coordinator/forecast/pilot_light.h"

namespace sheaf::coordinator {
namespace {

// The errors of all blocks are converted to this number of samples per pixel.
constexpr uint64_t kBaseSamples = kReplicateCount;
constexpr uint64_t kPairSamples = kPilotSamplesMax;
static_assert(kPilotSamples <= kReplicateCount);
// The fraction of the pilot's samples for the small image, and its maximum number of pixels.
constexpr double kMeanFraction = 0.1, kMeanPixelsMax = 1 << 14;
// The pixels of a light image; and a further one is this many times smaller than the frame, over
// the one before, or it is not worth its cost.
constexpr double kLightPixelsMin = 1 << 8, kLightPixelsMax = 1 << 14, kLightShrinkStep = 0.8;
// The fraction of the remaining samples for a pair, if they suffice for kPairBlocksMin blocks;
// fewer blocks tell less about the rate than its prior does.
constexpr double kPairFraction = 0.5, kPairBlocksMin = 200;
// More blocks than this do not improve the estimate noticeably.
constexpr double kBlocksEnough = 1 << 12;
constexpr double kPilotRateMin = 0.9, kPilotRateMax = 1.8;
constexpr int kBootstrapCount = 200;

// Number of samples of all pixels of a block.
double BlockSamples(uint64_t samples) {
  const PixelLattice lattice{kPixelStrideMin};
  return lattice.SamplesPerPixel(samples) * lattice.stride_px * lattice.stride_px;
}

int32_t StrideFor(double block_samples, double samples_per_pixel, int64_t frame_pixel_count) {
  const double least = std::sqrt(static_cast<double>(frame_pixel_count) / kBlocksEnough);
  const double stride = std::max(std::sqrt(block_samples / samples_per_pixel), least);
  return static_cast<int32_t>(
      std::clamp(std::ceil(stride), double{kPixelStrideMin}, double{kPixelStrideMax}));
}

class CellFinder {
 public:
  explicit CellFinder(std::span<const PixelRect> cells) : cells_(cells) {
    for (size_t i = 0; i < cells.size(); ++i) by_corner_[{cells[i].y0, cells[i].x0}] = i;
  }
  size_t Find(int32_t x, int32_t y) const {
    // Cells form rows of equal height, all divided alike.
    auto row = by_corner_.upper_bound({y, std::numeric_limits<int32_t>::max()});
    SHEAF_CHECK(row != by_corner_.begin());
    const int32_t y0 = std::prev(row)->first.first;
    const auto cell = std::prev(by_corner_.upper_bound({y0, x}));
    SHEAF_CHECK(x < cells_[cell->second].x1 && y < cells_[cell->second].y1);
    return cell->second;
  }

  // Also accepts pixels slightly outside the frame.
  size_t Nearest(int32_t x, int32_t y) const {
    const PixelRect all = window();
    return Find(std::clamp(x, all.x0, all.x1 - 1), std::clamp(y, all.y0, all.y1 - 1));
  }
  PixelRect window() const {
    return {cells_.front().x0, cells_.front().y0, cells_.back().x1, cells_.back().y1};
  }

 private:
  std::span<const PixelRect> cells_;
  std::map<std::pair<int32_t, int32_t>, size_t> by_corner_;
};

// The parts within the window of the cores of a lattice's blocks, row by row.
std::vector<PixelRect> CoresIn(const PixelLattice& lattice, const PixelRect& window) {
  const int32_t stride = lattice.stride_px;
  std::vector<PixelRect> cores;
  for (int32_t cell_y = window.y0 / stride; cell_y * stride < window.y1; ++cell_y) {
    for (int32_t cell_x = window.x0 / stride; cell_x * stride < window.x1; ++cell_x) {
      const PixelRect block = lattice.BlockOf(cell_x, cell_y);
      const PixelRect core = Intersect({block.x0 + kLatticeRimPx, block.y0 + kLatticeRimPx,
                                        block.x1 - kLatticeRimPx, block.y1 - kLatticeRimPx},
                                       window);
      if (!core.IsEmpty()) cores.push_back(core);
    }
  }
  return cores;
}

// The frame's mean, over independent places: the pixels of the small image, and the blocks. With
// the mean of the blocks alone, errors would be ten times too large if an emitter is visible but in
// no block. Blocks lack the light that light passes find, so they do not count beside a light
// image.
double FitMean(std::span<const PilotImage> pilot) {
  const bool has_light = FindLightImage(pilot) != nullptr;
  double sum = 0, places = 0;
  for (const PilotImage& image : pilot) {
    if (has_light && !image.level.lattice.All()) continue;
    const PixelRect& window = image.image.window;
    const double count = image.level.lattice.All()
                             ? static_cast<double>(window.PixelCount())
                             : static_cast<double>(CoresIn(image.level.lattice, window).size());
    sum += count * MeanOfImage(image.image);
    places += count;
  }
  return sum / places;
}

// light: null if the frame has no light passes. Errors are relative to the light of all paths.
std::vector<PilotBlock> BlocksOf(const PilotImage& pilot, const PilotImage* light,
                                 const CellFinder& cells, double mean) {
  const std::vector<PixelRect> cores = CoresIn(pilot.level.lattice, pilot.image.window);
  ErrorPlanes planes(pilot.image);
  std::array<std::vector<float>, 3> values;
  if (light != nullptr) {
    for (size_t i = 0; i < 3; ++i) values[i] = *planes.value[i];
    AddLightOf(*light, pilot.image, &values);
    for (size_t i = 0; i < 3; ++i) planes.value[i] = &values[i];
  }
  RareHits ignored;  // Only those of blocks; EmitterSilhouettes predicts the frame's.
  // Up to one sample per replicate, samples are independent.
  const double growth =
      static_cast<double>(std::min(pilot.level.samples, kBaseSamples)) / kBaseSamples;
  std::vector<PilotBlock> blocks;
  for (const PixelRect& core : cores) {
    ErrorSums error = SumErrors(planes, pilot.image, core, mean, 0, &ignored);
    error.sum *= growth;
    error.square_sum *= growth * growth;
    blocks.push_back({cells.Find((core.x0 + core.x1) / 2, (core.y0 + core.y1) / 2), error});
  }
  return blocks;
}

struct Rate {
  double value = kRatePrior, deviation = kRatePriorDeviation;
};

// pairs: the error sums of each block at kBaseSamples and at kPairSamples.
Rate FitRate(const std::vector<std::pair<double, double>>& pairs) {
  const double log_growth = std::log(static_cast<double>(kPairSamples) / kBaseSamples);
  const auto rate_of = [&](const auto& index_of) {
    double low = 0, high = 0;
    for (size_t i = 0; i < pairs.size(); ++i) {
      low += pairs[index_of(i)].first;
      high += pairs[index_of(i)].second;
    }
    return low > 0 && high > 0 ? std::log(low / high) / log_growth : kRatePrior;
  };
  if (pairs.size() < 8) return {};
  // Bootstrap: Efron 1979, "Bootstrap Methods: Another Look at the Jackknife".
  std::mt19937_64 random(pairs.size());
  double sum = 0, square_sum = 0;
  for (int i = 0; i < kBootstrapCount; ++i) {
    const double rate = rate_of([&](size_t) { return random() % pairs.size(); });
    sum += rate;
    square_sum += rate * rate;
  }
  const double mean = sum / kBootstrapCount;
  const double variance = std::max(1e-6, square_sum / kBootstrapCount - mean * mean);
  const double prior = 1 / (kRatePriorDeviation * kRatePriorDeviation);
  const double precision = 1 / variance + prior;
  const double rate =
      (rate_of([](size_t i) { return i; }) / variance + kRatePrior * prior) / precision;
  return {std::clamp(rate, kPilotRateMin, kPilotRateMax), 1 / std::sqrt(precision)};
}

// How many times smaller than the frame a light image is that costs `paths_left` paths per pixel.
int32_t LightShrink(double paths_left, double pixel_count, double light_paths_per_pixel) {
  const double paths = kPilotPasses * (1 + light_paths_per_pixel);
  const double most = std::sqrt(pixel_count / kLightPixelsMin);
  const double least = std::sqrt(pixel_count / kLightPixelsMax);
  const double wanted = paths_left > 0 ? std::sqrt(paths / paths_left) : most;
  return static_cast<int32_t>(std::ceil(std::max(2.0, std::max(least, std::min(wanted, most)))));
}

}  // namespace

std::vector<PilotLevel> PilotLevels(double samples_per_pixel, int64_t frame_pixel_count,
                                    uint64_t frame_seed, std::span<const PilotLevel> before,
                                    const PilotTechniques& techniques) {
  const auto pixel_count = static_cast<double>(frame_pixel_count);
  int32_t finest = kPixelStrideMax + 1, light_shrink = std::numeric_limits<int32_t>::max();
  for (const PilotLevel& level : before) {
    if (!level.lattice.All()) finest = std::min(finest, level.lattice.stride_px);
    if (level.is_light_image) light_shrink = std::min(light_shrink, level.shrink);
  }
  std::vector<PilotLevel> levels;
  double left = samples_per_pixel, light_left = techniques.light_paths_per_pixel * left;
  if (before.empty()) {
    const double shrink =
        std::sqrt(std::max(1 / (kMeanFraction * left), pixel_count / kMeanPixelsMax));
    levels.push_back({{}, 1, std::max(2, static_cast<int32_t>(std::ceil(shrink)))});
    left -= levels.back().SamplesPerPixel();
    light_left -= techniques.light_paths_per_pixel * levels.back().SamplesPerPixel();
  }
  const PixelLattice lattice{StrideFor(BlockSamples(kPilotSamples) + BlockSamples(kPairSamples),
                                       kPairFraction * left, frame_pixel_count),
                             frame_seed};
  const double blocks = pixel_count / (1.0 * lattice.stride_px * lattice.stride_px);
  if (!techniques.is_guided && lattice.stride_px < finest && blocks >= kPairBlocksMin) {
    for (const uint64_t samples : {kPairSamples, kPilotSamples}) {
      levels.push_back({lattice, samples});
      left -= levels.back().SamplesPerPixel();
    }
  }
  // Two images of the same lattice with the same samples would be equal.
  PixelLattice single{StrideFor(BlockSamples(kPilotSamples), left, frame_pixel_count), frame_seed};
  if (levels.size() > 1 && single.stride_px == lattice.stride_px) ++single.stride_px;
  if (single.stride_px < finest) levels.push_back({single, kPilotSamples});
  if (techniques.light_paths_per_pixel > 0) {
    // Last, when threads are warm, as the cost of its passes counts.
    const int32_t shrink = LightShrink(light_left, pixel_count, techniques.light_paths_per_pixel);
    if (shrink < kLightShrinkStep * light_shrink)
      levels.push_back({{}, kPilotPasses, shrink, true});
  }
  return levels;
}

absl::StatusOr<std::vector<double>> TileCpuSecondsOf(
    const std::map<std::string, std::string>& metadata, size_t tile_count) {
  const auto entry = metadata.find("tileCpuSeconds");
  std::vector<double> times;
  if (entry != metadata.end()) {
    for (const absl::string_view text : absl::StrSplit(entry->second, ' ', absl::SkipEmpty())) {
      if (!absl::SimpleAtod(text, &times.emplace_back())) times.clear();
    }
  }
  if (times.size() == tile_count) return times;
  return absl::DataLossError(
      "the coordinator does not report the cost of each tile of a pilot, so no quote is possible; "
      "it may be older than this program: use the same version of both");
}

absl::StatusOr<double> CpuSecondsOf(const std::map<std::string, std::string>& metadata,
                                    const std::string& key) {
  const auto entry = metadata.find(key);
  double seconds = 0;
  if (entry != metadata.end() && absl::SimpleAtod(entry->second, &seconds)) return seconds;
  return absl::DataLossError(
      absl::StrCat("the coordinator does not report the ", key,
                   " of a pilot, so no quote is possible; it may be older than this program: use "
                   "the same version of both"));
}

ErrorModel FitErrorModel(const CellGrid& grid, std::span<const PilotImage> pilot,
                         std::span<const ZoomedPilot> zoomed_pilots,
                         const FilterDescription& filter) {
  const std::vector<PixelRect>& cells = grid.cells();
  const CellFinder finder(cells);
  const double mean = FitMean(pilot);
  const PilotImage* light = FindLightImage(pilot);
  const auto cell_of = [&](int32_t x, int32_t y) { return finder.Nearest(x, y); };
  std::map<int32_t, std::vector<PilotBlock>> base, deep;  // By stride.
  ErrorModel model;
  double frame_paths = 0, training_count = 0;
  for (const PilotImage& image : pilot) {
    if (image.level.is_light_image) continue;
    if (image.level.lattice.All()) {
      model.silhouettes = EmitterSilhouettes(image.image, image.level.shrink, zoomed_pilots, mean,
                                             filter, finder.window(), cell_of);
      continue;
    }
    auto& levels = image.level.samples == kPilotSamples ? base : deep;
    levels[image.level.lattice.stride_px] = BlocksOf(image, light, finder, mean);
    frame_paths = static_cast<double>(image.image.frame_width_px) * image.image.frame_height_px;
    ++training_count;
    model.training_cpu_seconds +=
        (image.training_cpu_seconds - model.training_cpu_seconds) / training_count;
  }
  if (light != nullptr) model.light = FitLight(grid, *light, mean, cell_of, frame_paths);
  std::vector<PilotBlock> blocks;
  std::vector<std::pair<double, double>> pairs;
  for (const auto& [stride, low] : base) {
    blocks.insert(blocks.end(), low.begin(), low.end());
    const auto high = deep.find(stride);
    if (high == deep.end()) continue;
    for (size_t i = 0; i < low.size(); ++i) {
      pairs.emplace_back(low[i].error.sum, high->second[i].error.sum);
    }
  }
  const PilotErrors errors = FitCellErrors(grid, blocks);
  const Rate rate = FitRate(pairs);
  model.rate = rate.value;
  model.rate_deviation = rate.deviation;
  model.log_error_deviation = LogDeviationOf(blocks);
  // The mean over a few blocks of unequal error is usually below the true mean. If logarithms of
  // errors are normal, the median is below it by this factor.
  const double skew = std::exp(model.log_error_deviation * model.log_error_deviation / 2);
  const CpuModel cpu = FitCpu(grid, pilot, errors.of_cells);
  model.log_cpu_deviation = cpu.log_deviation;
  for (uint32_t i = 0; i < cells.size(); ++i) {
    ForecastCell cell;
    const auto count = static_cast<double>(cells[i].PixelCount());
    const double error = skew * errors.of_cells[i];
    cell.measured = {
        kBaseSamples,
        {cells[i].PixelCount(), count * error, count * errors.square_ratio * error * error}};
    cell.cpu_seconds_per_sample = count * cpu.seconds[i];
    model.cells.push_back(cell);
  }
  return model;
}

}  // namespace sheaf::coordinator
