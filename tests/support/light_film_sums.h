// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RenderBothFilms: a small frame, by the camera's paths and, where its settings ask for them, by
// paths from lights; and the means of its replicates.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

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

}  // namespace sheaf::render
