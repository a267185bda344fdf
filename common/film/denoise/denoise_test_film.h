// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Synthetic films with known light, for tests of the denoiser.
#pragma once

#include <cstdint>
#include <functional>

#include "common/film/denoise/denoise.h"
#include "common/film/film.h"
#include "common/film/film_test_samples.h"

namespace sheaf {

struct SyntheticPixel {
  double light = 1;      // The true value of R; G and B are 0.8 and 0.5 of it.
  double deviation = 0;  // The deviation of a sample, relative to the light.
  float albedo = 0.5F;
};

struct SyntheticFilm {
  FrameImage image;
  ReplicateHalves halves;
};

// A sample is the light times a number with mean 1: uniform about it, with this deviation.
inline SyntheticFilm MakeSyntheticFilm(
    int32_t size, uint64_t samples, uint64_t seed,
    const std::function<SyntheticPixel(int32_t, int32_t)>& pixel_at) {
  FilmOutputs outputs;
  AddDenoised(&outputs);
  const PixelRect rect{0, 0, size, size};
  FilmTile tile(rect, {0, samples}, outputs);
  OutputSample none(outputs);
  {
    PixelAccumulator accumulator(&tile);
    for (int32_t y = 0; y < size; ++y) {
      for (int32_t x = 0; x < size; ++x) {
        const SyntheticPixel pixel = pixel_at(x, y);
        accumulator.Begin(x, y);
        for (uint64_t n = 0; n < samples; ++n) {
          const auto at = static_cast<uint64_t>(y * size + x);
          const double unit = double{HashToUnit((seed * 1'000'003 + at) * 4096 + n)};
          constexpr double kUniformDeviation = 0.288675;
          const double value =
              pixel.light * (1 + pixel.deviation * (unit - 0.5) / kUniformDeviation);
          const auto light = static_cast<float>(value);
          FilmSample sample;
          sample.radiance = {light, 0.8F * light, 0.5F * light};
          sample.alpha = 1;
          sample.albedo = Rgb::Gray(pixel.albedo);
          sample.normal = {0, 0, 1};
          sample.depth = 1;
          accumulator.Add(n, sample, none);
        }
        accumulator.End();
      }
    }
  }
  SyntheticFilm film{MakeFrameImage(rect, size, size, outputs), ReplicateHalves(rect)};
  DevelopTile(tile, &film.image);
  film.halves.DevelopTile(tile, film.image.color);
  return film;
}

// The mean squared error over pixels and R, G, B.
inline double SyntheticError(const std::array<std::vector<float>, 3>& color, int32_t size,
                             const std::function<SyntheticPixel(int32_t, int32_t)>& pixel_at) {
  double sum = 0;
  for (size_t i = 0; i < 3; ++i) {
    for (int32_t y = 0; y < size; ++y) {
      for (int32_t x = 0; x < size; ++x) {
        const double truth = pixel_at(x, y).light * (i == 0 ? 1 : i == 1 ? 0.8 : 0.5);
        const double error = double{color[i][static_cast<size_t>(y * size + x)]} - truth;
        sum += error * error;
      }
    }
  }
  return sum / (3.0 * size * size);
}

}  // namespace sheaf
