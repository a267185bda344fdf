// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FilmResponse: converts the radiance of a path to film values. Wavelengths are converted to linear
// sRGB by the CIE observer or a camera's sensor, and multiplied by the exposure; where the scene
// requests it, samples that are too bright are clamped.
#pragma once

#include <memory>

#include "common/math/transform.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/color/spectral_color.h"
#include "worker/render/color/wavelengths.h"

namespace sheaf::render {

class FilmResponse {
 public:
  static FilmResponse Make(const FilmDescription& film, const FrameSettings& settings);

  Rgb Of(const Spectral& radiance, const Wavelengths& wavelengths) const {
    return RgbOf(radiance, wavelengths, *observer_) * exposure_;
  }
  // In RGB transport sensors differ from the observer only in their white balance.
  Rgb Of(Rgb radiance, NoWavelengths /*none*/) const { return radiance * exposure_; }

  // Scales a sample, and *weight of its layers equally, so that none of the sensor's three
  // responses (X, Y and Z for the observer) exceeds the limit. Source: pbrt-v4's
  // "maxcomponentvalue".
  void Clamp(Rgb* sample, float* weight) const {
    if (component_max_ <= 0) return;
    const float scale = ClampScale(*sample);
    *sample *= scale;
    *weight *= scale;
  }

 private:
  float ClampScale(Rgb sample) const;

  float exposure_ = 1;
  double component_max_ = 0;  // 0: not clamped.
  Matrix4 sensor_from_rgb_;
  std::shared_ptr<const ObserverTable> sensor_;  // Null for the CIE observer.
  const ObserverTable* observer_ = nullptr;
};

}  // namespace sheaf::render
