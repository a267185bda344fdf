// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/pilot_model.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <random>
#include <utility>

#include "common/base/check.h"
#include "common/film/error_estimate.h"

namespace sheaf::coordinator {
namespace {

constexpr uint64_t kBaseSamples = kReplicateCount;
constexpr uint64_t kPairSamples = kPilotSamplesMax;
// Of the price, what goes into the picture that is not of the pair.
constexpr double kSingleShare = 0.35;
// More blocks than these tell nothing that matters.
constexpr double kBlocksEnough = 1 << 12;
// What is known of b before anything was rendered; over scenes of all kinds.
constexpr double kRatePrior = 1.1, kRatePriorDeviation = 0.1;
constexpr double kRateMin = 0.9, kRateMax = 1.8;
// What a thread takes longer in its first milliseconds, with cold caches; measured over small
// scenes. Of a pilot, it is taken for no more than this share.
constexpr double kColdSeconds = 2.5e-3, kColdShareMax = 0.3;
constexpr int kBootstrapCount = 200;

// Of a block's pixels, all together.
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

struct PixelError {
  size_t tile = 0;
  double error = 0;
};
using Cell = std::pair<int32_t, int32_t>;
// Of a picture's lattice: the errors of each cell's block.
using Blocks = std::map<Cell, std::vector<PixelError>>;

class TileFinder {
 public:
  explicit TileFinder(std::span<const PixelRect> tiles) : tiles_(tiles) {
    for (size_t i = 0; i < tiles.size(); ++i) by_corner_[{tiles[i].y0, tiles[i].x0}] = i;
  }
  size_t Find(int32_t x, int32_t y) const {
    // Tiles are rows of equal height, cut alike.
    auto row = by_corner_.upper_bound({y, std::numeric_limits<int32_t>::max()});
    SHEAF_CHECK(row != by_corner_.begin());
    const int32_t y0 = std::prev(row)->first.first;
    const auto tile = std::prev(by_corner_.upper_bound({y0, x}));
    SHEAF_CHECK(x < tiles_[tile->second].x1 && y < tiles_[tile->second].y1);
    return tile->second;
  }

 private:
  std::span<const PixelRect> tiles_;
  std::map<std::pair<int32_t, int32_t>, size_t> by_corner_;
};

Blocks ErrorsOf(const PilotPicture& pilot, const TileFinder& tiles) {
  const std::vector<double> errors = EstimatePixelErrors(pilot.picture);
  const PixelRect& window = pilot.picture.window;
  const PixelLattice& lattice = pilot.level.lattice;
  const int32_t stride = lattice.stride_px;
  Blocks blocks;
  size_t next = 0;
  for (int32_t y = window.y0; y < window.y1; ++y) {
    for (int32_t x = window.x0; x < window.x1; ++x, ++next) {
      if (lattice.PartOf(x, y) != PixelLattice::Part::kCore) continue;
      blocks[{x / stride, y / stride}].push_back({tiles.Find(x, y), errors[next]});
    }
  }
  return blocks;
}

// Of a block, whose pixels err alike.
struct BlockSum {
  double count = 0, error = 0;
};
BlockSum SumOf(const std::vector<PixelError>& block) {
  BlockSum sum{static_cast<double>(block.size()), 0};
  for (const PixelError& pixel : block) sum.error += pixel.error;
  return sum;
}

// Relative, of the mean error over all pixels: a ratio over blocks of unequal sizes.
// Source: Cochran 1977, Sampling Techniques, sec. 9A.2.
double LogDeviationOf(const std::vector<BlockSum>& blocks) {
  double count = 0, error = 0, squares = 0;
  for (const BlockSum& block : blocks) {
    count += block.count;
    error += block.error;
  }
  if (blocks.size() < 2 || error <= 0) return 0;
  for (const BlockSum& block : blocks) {
    const double difference = block.error - error / count * block.count;
    squares += difference * difference;
  }
  const auto n = static_cast<double>(blocks.size());
  return std::sqrt(squares * n / (n - 1)) / error;
}

struct Rate {
  double value = kRatePrior, deviation = kRatePriorDeviation;
};

// pairs: summed errors of a block at kBaseSamples and at kPairSamples.
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
  // Efron 1979, "Bootstrap Methods: Another Look at the Jackknife".
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
  return {std::clamp(rate, kRateMin, kRateMax), 1 / std::sqrt(precision)};
}

// Errors of tiles from few pixels each: nearer to their common mean the more they look alike.
class TileErrors {
 public:
  TileErrors(size_t tile_count, const std::vector<PixelError>& pixels) : of_tile_(tile_count) {
    for (const PixelError& pixel : pixels) {
      for (Sums* sums : {&of_tile_[pixel.tile], &all_}) {
        ++sums->count;
        sums->sum += pixel.error;
        sums->square_sum += pixel.error * pixel.error;
      }
    }
    double within = 0, between = 0, noise = 0, freedom = 0;
    const double mean = Mean();
    for (const Sums& tile : of_tile_) {
      if (tile.count < 2) continue;
      within += tile.square_sum - tile.sum * tile.sum / tile.count;
      freedom += tile.count - 1;
      const double difference = tile.sum / tile.count - mean;
      between += tile.count * difference * difference;
      noise += 1;
    }
    if (freedom == 0) return;
    within_ = within / freedom;
    // Sources of variance by the one-way analysis; Searle 1971, Linear Models, chapter 10.
    const double per_tile = all_.count / std::max(1.0, noise);
    between_ = std::max(0.0, (between / std::max(1.0, noise - 1) - within_) / per_tile);
  }
  double Mean() const { return all_.count == 0 ? 0 : all_.sum / all_.count; }
  double MeanOf(size_t tile) const {
    const Sums& sums = of_tile_[tile];
    if (sums.count == 0 || between_ == 0) return Mean();
    const double weight = between_ / (between_ + within_ / sums.count);
    return weight * sums.sum / sums.count + (1 - weight) * Mean();
  }
  // Mean square of a pixel's error over the square of its tile's mean.
  double SquareRatio() const {
    double squares = 0;
    for (size_t i = 0; i < of_tile_.size(); ++i) {
      squares += of_tile_[i].count * MeanOf(i) * MeanOf(i);
    }
    return squares == 0 ? 1 : std::max(1.0, all_.square_sum / squares);
  }

 private:
  struct Sums {
    double count = 0, sum = 0, square_sum = 0;
  };
  std::vector<Sums> of_tile_;
  Sums all_;
  double within_ = 0, between_ = 0;
};

// What pictures took.
struct Cost {
  double pixel_count = 0, samples = 0, cpu_seconds = 0;
};

// CPU seconds that each pixel of a picture costs besides its samples, whether it has any or not:
// for the film and for what goes with a part. It is little in a picture and much in a pilot. The
// two of a pair have the same.
double FitIdleCost(std::span<const PilotPicture> pilot) {
  std::map<int32_t, std::map<uint64_t, Cost>> levels;  // By stride and samples.
  for (const PilotPicture& picture : pilot) {
    const PilotLevel& level = picture.level;
    Cost& cost = levels[level.lattice.stride_px][level.samples];
    cost.pixel_count = static_cast<double>(picture.picture.window.PixelCount());
    cost.samples =
        static_cast<double>(level.lattice.SampleCountIn(picture.picture.window, level.samples));
    for (const double seconds : picture.cpu_seconds_of_tiles) cost.cpu_seconds += seconds;
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
  return pixel_count == 0 ? 0 : std::max(0.0, idle_seconds) / pixel_count;
}

struct CpuModel {
  std::vector<double> seconds;  // Of one sample of a pixel, in each tile.
  double log_deviation = 0;     // Of the frame's, for the choice of blocks and for cold caches.
};

CpuModel FitCpu(std::span<const PixelRect> tiles, std::span<const PilotPicture> pilot,
                int thread_count) {
  const size_t tile_count = tiles.size();
  const double idle = FitIdleCost(pilot);
  std::vector<Cost> of_tile(tile_count);
  Cost all;
  for (const PilotPicture& picture : pilot) {
    const PilotLevel& level = picture.level;
    for (size_t i = 0; i < tile_count; ++i) {
      const double idle_seconds = idle * static_cast<double>(tiles[i].PixelCount());
      of_tile[i].samples +=
          static_cast<double>(level.lattice.SampleCountIn(tiles[i], level.samples));
      of_tile[i].cpu_seconds += std::max(0.0, picture.cpu_seconds_of_tiles[i] - idle_seconds);
    }
  }
  for (const Cost& cost : of_tile) {
    all.samples += cost.samples;
    all.cpu_seconds += cost.samples > 0 ? cost.cpu_seconds : 0;
  }
  const double cold = std::min(kColdSeconds * thread_count, kColdShareMax * all.cpu_seconds);
  const double warm = 1 - cold / all.cpu_seconds;
  const double mean = all.cpu_seconds / all.samples;
  double squares = 0;
  CpuModel model;
  for (const Cost& cost : of_tile) {
    const double own = cost.samples > 0 ? cost.cpu_seconds / cost.samples : mean;
    model.seconds.push_back(warm * own);
    squares += (cost.cpu_seconds - mean * cost.samples) * (cost.cpu_seconds - mean * cost.samples);
  }
  model.log_deviation = std::hypot(std::sqrt(squares) / all.cpu_seconds, 1 - warm);
  return model;
}

}  // namespace

std::vector<PilotLevel> PilotPair(double samples_per_pixel, int64_t frame_pixel_count) {
  if (samples_per_pixel <= 0) return {};
  const PixelLattice lattice{StrideFor(BlockSamples(kBaseSamples) + BlockSamples(kPairSamples),
                                       samples_per_pixel, frame_pixel_count)};
  // The larger goes first, so that caches are warm for the other.
  const std::vector<PilotLevel> levels{{lattice, kPairSamples}, {lattice, kBaseSamples}};
  if (levels[0].SamplesPerPixel() + levels[1].SamplesPerPixel() > samples_per_pixel) return {};
  return levels;
}

std::vector<PilotLevel> PilotLevels(double samples_per_pixel, int64_t frame_pixel_count) {
  const double single = kSingleShare * samples_per_pixel;
  std::vector<PilotLevel> levels = PilotPair(samples_per_pixel - single, frame_pixel_count);
  PixelLattice lattice{StrideFor(BlockSamples(kBaseSamples), single, frame_pixel_count)};
  // Pictures of one lattice and one number of samples would be the same.
  if (!levels.empty() && lattice.stride_px == levels[0].lattice.stride_px) ++lattice.stride_px;
  levels.insert(levels.begin() + (levels.empty() ? 0 : 1), {lattice, kBaseSamples});
  return levels;
}

ErrorModel FitErrorModel(std::span<const PixelRect> tiles, std::span<const PilotPicture> pilot,
                         int thread_count) {
  const TileFinder finder(tiles);
  std::map<int32_t, Blocks> base, deep;  // By stride.
  for (const PilotPicture& picture : pilot) {
    auto& levels = picture.level.samples == kBaseSamples ? base : deep;
    levels[picture.level.lattice.stride_px] = ErrorsOf(picture, finder);
  }
  std::vector<PixelError> pixels;
  std::vector<BlockSum> blocks;
  std::vector<std::pair<double, double>> pairs;
  for (const auto& [stride, low] : base) {
    const auto high = deep.find(stride);
    for (const auto& [cell, block] : low) {
      pixels.insert(pixels.end(), block.begin(), block.end());
      blocks.push_back(SumOf(block));
      if (high == deep.end()) continue;
      pairs.emplace_back(blocks.back().error, SumOf(high->second.at(cell)).error);
    }
  }
  const TileErrors errors(tiles.size(), pixels);
  ErrorModel model;
  const Rate rate = FitRate(pairs);
  model.rate = rate.value;
  model.rate_deviation = rate.deviation;
  model.log_error_deviation = LogDeviationOf(blocks);

  for (const PilotPicture& picture : pilot) {
    SHEAF_CHECK(picture.cpu_seconds_of_tiles.size() == tiles.size());
  }
  const CpuModel cpu = FitCpu(tiles, pilot, thread_count);
  model.log_cpu_deviation = cpu.log_deviation;
  const double square_ratio = errors.SquareRatio();
  for (size_t i = 0; i < tiles.size(); ++i) {
    ForecastTile tile;
    const auto count = static_cast<double>(tiles[i].PixelCount());
    const double error = errors.MeanOf(i);
    tile.measured = {kBaseSamples,
                     {tiles[i].PixelCount(), count * error, count * square_ratio * error * error}};
    tile.cpu_seconds_per_sample = count * cpu.seconds[i];
    model.tiles.push_back(tile);
  }
  return model;
}

}  // namespace sheaf::coordinator
