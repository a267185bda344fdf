// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/setting_renderer.h"

#include "coordinator/core/job/job.h"

namespace sheaf::cli {

SettingRenderer::SettingRenderer(const StudyScene& scene, const std::vector<PixelRect>& tiles,
                                 double scale, int threads)
    : settings_(SettingsOf(*scene.frame)),
      scale_(scale),
      training_cpu_seconds_(scene.training_cpu_seconds) {
  if (scene.light() != nullptr) light_ = std::make_unique<LightPasses>(*scene.light(), threads);
  tiles_ = std::make_unique<TileRenderer>(*scene.frame, tiles, threads, light_.get());
}

void SettingRenderer::AddLightTo(const PixelRect& tile, TilePixels* pixels) {
  if (light_ == nullptr) return;
  const FrameImage light = LightOf(light_->Image(), tile, settings_.width_px, settings_.height_px);
  AddPixels(PixelsOf(light), pixels);
}

double SettingRenderer::LightCpuSeconds() const {
  return light_ == nullptr ? 0 : light_->CpuSeconds(coordinator::PathsPerLightPass(settings_));
}

}  // namespace sheaf::cli
