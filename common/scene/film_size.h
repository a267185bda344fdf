// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The size of the image where a user asks for another one than the scene's.
#pragma once

#include <cstdint>

#include "common/scene/scene_description.h"

namespace sheaf {

// A size in pixels, or a part of the scene's size, or neither.
struct FilmSize {
  int32_t width_px = 0, height_px = 0;
  double fraction = 0;

  bool IsInPixels() const { return width_px > 0; }
  bool IsDefault() const { return !IsInPixels() && fraction == 0; }
};

// Gives the film this size. The camera sees what it would see if the scene's file stated the size:
// where pixels are square, they remain so, and the shorter side of the image shows the same extent
// about the same center, as pbrt-v4 does without a "screenwindow". Where they are not, the screen
// window is kept. A crop remains the same part of the film. Requires: positive sizes.
void ResizeFilm(int32_t width_px, int32_t height_px, SceneDescription* scene);
// The same for a size that need not be given; nothing is smaller than a pixel.
void ResizeFilm(const FilmSize& size, SceneDescription* scene);

}  // namespace sheaf
