// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/path_noise.h"

#include <algorithm>
#include <utility>

#include "common/base/check.h"
#include "common/film/film_tile.h"

namespace sheaf::render {
namespace {

// Per replicate of a pixel, the weighted sum of R, G and B of one kind of path.
using Replicates = std::array<double, kReplicateCount>;
struct PixelKinds {
  std::array<Replicates, kLightPathKindCount> kinds{};
  Replicates weights{};
};

void AddSample(const FilmTile& sample, uint64_t index, std::vector<PixelKinds>* pixels) {
  const size_t replicate = index % kReplicateCount;
  for (size_t p = 0; p < pixels->size(); ++p) {
    PixelKinds& pixel = (*pixels)[p];
    pixel.weights[replicate] += static_cast<double>(sample.channel(FilmChannel::kWeight)[p]);
    for (size_t kind = 0; kind < kLightPathKindCount; ++kind) {
      for (size_t c = 0; c < 3; ++c) {
        pixel.kinds[kind][replicate] += static_cast<double>(sample.mean(3 * kind + c, 0)[p]);
      }
    }
  }
}

// Deviations of the ratios sum / weight, as in error_estimate.h.
Replicates DeviationsOf(const Replicates& sums, const Replicates& weights) {
  double sum = 0, weight = 0;
  for (size_t r = 0; r < kReplicateCount; ++r) {
    sum += sums[r];
    weight += weights[r];
  }
  Replicates deviations{};
  if (weight == 0) return deviations;
  for (size_t r = 0; r < kReplicateCount; ++r) {
    deviations[r] = (sums[r] - sum / weight * weights[r]) / weight;
  }
  return deviations;
}

double MeanOf(const Replicates& sums, const Replicates& weights) {
  double sum = 0, weight = 0;
  for (size_t r = 0; r < kReplicateCount; ++r) {
    sum += sums[r];
    weight += weights[r];
  }
  return weight == 0 ? 0 : sum / weight;
}

struct Squares {
  double sum = 0, largest = 0;
};
Squares SquaresOf(const Replicates& deviations) {
  Squares squares;
  for (const double d : deviations) {
    squares.sum += d * d;
    squares.largest = std::max(squares.largest, d * d);
  }
  return squares;
}

}  // namespace

absl::StatusOr<PathNoiseSums> PathNoiseSums::Of(const CompiledScene& scene, PixelRect tile,
                                                uint64_t samples, double floor) {
  SHEAF_CHECK(SettingsOf(scene).outputs.light_paths && samples >= 2 * kReplicateCount);
  std::vector<PixelKinds> pixels(static_cast<size_t>(tile.PixelCount()));
  for (uint64_t n = 0; n < samples; ++n) {
    RenderStats stats;
    const absl::StatusOr<FilmTile> sample = RenderTilePass(scene, tile, {n, 1}, {}, &stats);
    if (!sample.ok()) return sample.status();
    AddSample(*sample, n, &pixels);
  }
  double mean = 0;
  for (const PixelKinds& pixel : pixels) {
    for (const Replicates& kind : pixel.kinds) {
      mean += MeanOf(kind, pixel.weights) / static_cast<double>(pixels.size());
    }
  }
  PathNoiseSums sums;
  const double divisor = mean * mean + floor * floor;
  if (!(divisor > 0)) return sums;
  for (const PixelKinds& pixel : pixels) {
    Replicates total{};
    std::array<Replicates, kLightPathKindCount> deviations;
    for (size_t k = 0; k < kLightPathKindCount; ++k) {
      deviations[k] = DeviationsOf(pixel.kinds[k], pixel.weights);
      for (size_t r = 0; r < kReplicateCount; ++r) total[r] += deviations[k][r];
    }
    for (size_t k = 0; k < kLightPathKindCount; ++k) {
      Kind& kind = sums.kinds_[k];
      kind.light += MeanOf(pixel.kinds[k], pixel.weights);
      for (size_t r = 0; r < kReplicateCount; ++r) {
        kind.covariance += deviations[k][r] * total[r] / divisor;
      }
      const Squares squares = SquaresOf(deviations[k]);
      kind.variance += squares.sum / divisor;
      kind.one_replicate += squares.largest / divisor;
    }
    const Squares squares = SquaresOf(total);
    sums.all_.variance += squares.sum / divisor;
    sums.all_.one_replicate += squares.largest / divisor;
  }
  return sums;
}

void PathNoiseSums::Add(const PathNoiseSums& other) {
  const auto add = [](const Kind& from, Kind* to) {
    to->light += from.light;
    to->covariance += from.covariance;
    to->variance += from.variance;
    to->one_replicate += from.one_replicate;
  };
  for (size_t k = 0; k < kLightPathKindCount; ++k) add(other.kinds_[k], &kinds_[k]);
  add(other.all_, &all_);
}

PathNoise PathNoiseSums::Fractions() const {
  const auto fraction = [](double part, double whole) { return whole > 0 ? part / whole : 0; };
  double light = 0;
  for (const Kind& kind : kinds_) light += kind.light;
  PathNoise noise;
  for (size_t k = 0; k < kLightPathKindCount; ++k) {
    noise.kinds[k] = {fraction(kinds_[k].light, light),
                      fraction(kinds_[k].covariance, all_.variance),
                      fraction(kinds_[k].one_replicate, kinds_[k].variance)};
  }
  noise.one_replicate_fraction = fraction(all_.one_replicate, all_.variance);
  return noise;
}

}  // namespace sheaf::render
