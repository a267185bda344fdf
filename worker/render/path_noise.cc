// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/path_noise.h"

#include <algorithm>
#include <utility>

#include "common/base/check.h"
#include "common/base/first_error.h"
#include "common/base/parallel.h"
#include "worker/render/light_pass.h"

namespace sheaf::render {
namespace {

using Replicates = std::array<double, kReplicateCount>;

void AddSample(const FilmTile& sample, uint64_t index, PathSums* pixels) {
  const size_t replicate = index % kReplicateCount;
  for (size_t p = 0; p < pixels->size(); ++p) {
    PixelPaths& pixel = (*pixels)[p];
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

// The means of a pixel's kinds, and the deviations of their replicates.
struct PixelNoise {
  std::array<double, kLightPathKindCount> means{};
  std::array<Replicates, kLightPathKindCount> deviations{};
};

void AddNoiseOf(const PixelPaths& pixel, PixelNoise* noise) {
  for (size_t k = 0; k < kLightPathKindCount; ++k) {
    noise->means[k] += MeanOf(pixel.kinds[k], pixel.weights);
    const Replicates deviations = DeviationsOf(pixel.kinds[k], pixel.weights);
    for (size_t r = 0; r < kReplicateCount; ++r) noise->deviations[k][r] += deviations[r];
  }
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

absl::StatusOr<PathSums> SumLightPaths(const CompiledScene& scene, uint64_t passes, int threads) {
  const FrameSettings& settings = SettingsOf(scene);
  SHEAF_CHECK(settings.outputs.light_paths && passes >= 2 * kReplicateCount);
  PathSums pixels(static_cast<size_t>(settings.window.PixelCount()));
  FirstError failure;
  // Each replicate has sums of its own, so that its passes are added in their order.
  ParallelRanges(kReplicateCount, 1, threads, [&](uint64_t replicate, uint64_t) {
    for (uint64_t n = replicate; n < passes; n += kReplicateCount) {
      absl::StatusOr<FilmTile> pass = RenderLightPass(scene, settings.window, {n, 1}, {}, nullptr);
      if (!pass.ok()) return failure.Update(pass.status());
      AddSample(*pass, n, &pixels);
    }
  });
  if (absl::Status status = failure.Get(); !status.ok()) return status;
  return pixels;
}

absl::StatusOr<PathNoiseSums> PathNoiseSums::Of(const CompiledScene& scene, PixelRect tile,
                                                uint64_t samples, double floor,
                                                const LightBeside& light) {
  SHEAF_CHECK(SettingsOf(scene).outputs.light_paths && samples >= 2 * kReplicateCount);
  PathSums pixels(static_cast<size_t>(tile.PixelCount()));
  for (uint64_t n = 0; n < samples; ++n) {
    RenderStats stats;
    const absl::StatusOr<FilmTile> sample = RenderTilePass(scene, tile, {n, 1}, {}, &stats);
    if (!sample.ok()) return sample.status();
    AddSample(*sample, n, &pixels);
  }
  std::vector<PixelNoise> noise(pixels.size());
  double mean = 0;
  for (size_t p = 0; p < pixels.size(); ++p) {
    AddNoiseOf(pixels[p], &noise[p]);
    if (light.sums != nullptr) {
      const auto at = static_cast<int32_t>(p);
      const size_t index = light.index_of(tile.x0 + at % tile.Width(), tile.y0 + at / tile.Width());
      AddNoiseOf((*light.sums)[index], &noise[p]);
    }
    for (const double of_kind : noise[p].means)
      mean += of_kind / static_cast<double>(pixels.size());
  }
  PathNoiseSums sums;
  const double divisor = mean * mean + floor * floor;
  if (!(divisor > 0)) return sums;
  for (const PixelNoise& pixel : noise) sums.AddPixel(pixel.means, pixel.deviations, divisor);
  return sums;
}

void PathNoiseSums::AddPixel(const std::array<double, kLightPathKindCount>& means,
                             const std::array<Replicates, kLightPathKindCount>& deviations,
                             double divisor) {
  Replicates total{};
  for (const Replicates& of_kind : deviations) {
    for (size_t r = 0; r < kReplicateCount; ++r) total[r] += of_kind[r];
  }
  for (size_t k = 0; k < kLightPathKindCount; ++k) {
    Kind& kind = kinds_[k];
    kind.light += means[k];
    for (size_t r = 0; r < kReplicateCount; ++r) {
      kind.covariance += deviations[k][r] * total[r] / divisor;
    }
    const Squares squares = SquaresOf(deviations[k]);
    kind.variance += squares.sum / divisor;
    kind.one_replicate += squares.largest / divisor;
  }
  const Squares squares = SquaresOf(total);
  all_.variance += squares.sum / divisor;
  all_.one_replicate += squares.largest / divisor;
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
