// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/pilot_cost.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "common/base/check.h"

namespace sheaf::coordinator {
namespace {

// CPU seconds that a pixel costs without any sample, where no pair tells it: for the film.
constexpr double kIdleSeconds = 7e-8;
// What is known of a sample's cost in a tile before is worth so many blocks there.
constexpr double kCostBlocks = 1;

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
  return pixel_count == 0 ? kIdleSeconds : std::max(0.0, idle_seconds) / pixel_count;
}

}  // namespace

CpuModel FitCpu(std::span<const PixelRect> tiles, std::span<const PilotPicture> pilot) {
  const double idle = FitIdleCost(pilot);
  std::vector<Cost> of_tile(tiles.size());
  Cost all;
  for (const PilotPicture& picture : pilot) {
    const PilotLevel& level = picture.level;
    if (level.lattice.All()) continue;
    SHEAF_CHECK(picture.cpu_seconds_of_tiles.size() == tiles.size());
    for (size_t i = 0; i < tiles.size(); ++i) {
      const auto samples =
          static_cast<double>(level.lattice.SampleCountIn(tiles[i], level.samples));
      if (samples == 0) continue;
      const double taken = picture.cpu_seconds_of_tiles[i];
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
  CpuModel model;
  for (const Cost& cost : of_tile) {
    const double own = (cost.cpu_seconds + known * mean) / (cost.samples + known);
    model.seconds.push_back(std::max(own, 0.01 * mean));
    squares += (cost.cpu_seconds - mean * cost.samples) * (cost.cpu_seconds - mean * cost.samples);
  }
  model.log_deviation = std::sqrt(squares) / all.cpu_seconds;
  return model;
}

}  // namespace sheaf::coordinator
