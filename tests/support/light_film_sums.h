// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RenderBothFilms: a small frame, by the camera's paths and, where its settings ask for them, by
// paths from lights; and the means of its replicates.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <numeric>
#include <optional>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/test_scene.h"
#include "worker/render/light_pass.h"

namespace sheaf::render {

struct BothFilms {
  FilmTile camera;
  std::optional<FilmTile> light;

  // One color component of a pixel's mean over one replicate.
  double Mean(uint32_t replicate, size_t component, size_t pixel) const {
    double mean = MeanOf(camera, replicate, component, pixel);
    if (light) mean += MeanOf(*light, replicate, component, pixel);
    return mean;
  }

 private:
  static double MeanOf(const FilmTile& film, uint32_t replicate, size_t component, size_t pixel) {
    return static_cast<double>(film.replicate(replicate, component)[pixel]) /
           static_cast<double>(film.replicate(replicate, 3)[pixel]);
  }
};

// Fails the test where a sample is not finite, or media do not nest.
inline BothFilms RenderBothFilms(const CompiledScene& scene) {
  const FrameSettings& settings = SettingsOf(scene);
  RenderStats stats;
  BothFilms films{RenderAll(scene, &stats), std::nullopt};
  EXPECT_TRUE(stats.non_finite.empty());
  if (!HasLightPaths(settings.techniques)) return films;
  RenderStats light_stats;
  absl::StatusOr<FilmTile> light =
      RenderLightPass(scene, settings.window, {0, settings.samples}, {}, &light_stats);
  EXPECT_TRUE(light.ok()) << light.status();
  EXPECT_TRUE(light_stats.non_finite.empty());
  EXPECT_EQ(light_stats.broken_nestings, 0u);
  films.light = *std::move(light);
  return films;
}

struct ComponentMean {
  double value = 0, standard_error = 0;
};
// The mean of a color component over pixels: the camera's paths plus the light paths.
inline ComponentMean MeanOverPixels(const BothFilms& films, size_t component,
                                    const std::vector<size_t>& pixels) {
  std::array<double, kReplicateCount> means{};
  ComponentMean mean;
  for (uint32_t r = 0; r < kReplicateCount; ++r) {
    for (const size_t pixel : pixels) {
      means[r] += films.Mean(r, component, pixel) / static_cast<double>(pixels.size());
    }
    mean.value += means[r] / kReplicateCount;
  }
  double squares = 0;
  for (const double m : means) squares += (m - mean.value) * (m - mean.value);
  mean.standard_error = std::sqrt(squares / (kReplicateCount * (kReplicateCount - 1)));
  return mean;
}
inline ComponentMean MeanOverPixels(const BothFilms& films, size_t component) {
  std::vector<size_t> all(films.camera.plane_size());
  std::iota(all.begin(), all.end(), size_t{0});
  return MeanOverPixels(films, component, all);
}

}  // namespace sheaf::render
