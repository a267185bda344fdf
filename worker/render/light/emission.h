// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Emission: the color and strength with which a light emits.
#pragma once

#include <cmath>
#include <cstdint>

#include "common/math/vec.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

// The emission of a light: as RGB, which also weights it against other lights, and as a spectrum of
// the light table times a scale. The spectra of SceneDescription::area_lights come first in the
// table, each once however many shapes use it. Without a spectrum, spectral transport upsamples
// rgb.
struct Emission {
  Emission() = default;
  // From a plain color, for the initializer lists of emitters.
  Emission(Rgb color) : rgb(color) {}
  Emission(const ColorSpec& color, float scale, int32_t spectrum_index)
      : rgb(color.rgb * scale), spectrum(spectrum_index), spectrum_scale(scale) {}

  Rgb rgb;
  int32_t spectrum = kNone;
  float spectrum_scale = 1;
};

// |L| for the choice among lights: counts either sign, and is positive wherever a channel is not 0.
inline float StrengthOf(Rgb c) {
  if (!IsFinite(c)) return 0;
  return Luminance({std::fabs(c.r), std::fabs(c.g), std::fabs(c.b)});
}

}  // namespace sheaf::render
