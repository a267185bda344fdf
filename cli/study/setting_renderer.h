// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SettingRenderer: renders a study's tiles with one setting, with its light passes, and computes
// the cost of the whole image.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "cli/study/light_passes.h"
#include "cli/study/study_scenes.h"
#include "cli/study/study_tiles.h"

namespace sheaf::cli {

// Not thread-safe.
class SettingRenderer {
 public:
  // scale: pixels of the window over those of the tiles. The scene and the tiles must outlive it.
  SettingRenderer(const StudyScene& scene, const std::vector<PixelRect>& tiles, double scale,
                  int threads);

  TileRenderer& tiles() { return *tiles_; }
  const TileRenderer& tiles() const { return *tiles_; }
  // The light of a tile; adds nothing without light paths. Requires: a block was rendered.
  void AddLightTo(const PixelRect& tile, TilePixels* pixels);
  bool has_light() const { return light_ != nullptr; }

  // CPU seconds of the whole image with as many samples as the tiles have: of its samples, light
  // passes and training.
  double CpuSeconds() const {
    return scale_ * tiles_->CpuSeconds() + LightCpuSeconds() + training_cpu_seconds_;
  }
  // CPU seconds of the light passes so far and of the training.
  double LightCpuSeconds() const;
  double training_cpu_seconds() const { return training_cpu_seconds_; }

 private:
  const FrameSettings& settings_;
  double scale_, training_cpu_seconds_;
  std::unique_ptr<LightPasses> light_;  // Null without light paths.
  std::unique_ptr<TileRenderer> tiles_;
};

}  // namespace sheaf::cli
