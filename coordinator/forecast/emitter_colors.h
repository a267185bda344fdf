// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// EmitterColors: separates emitters from their surroundings in a pilot's image with one sample per
// pixel, using the image's layer `emission` (light_path_kind.h), which holds the emission that the
// camera sees directly.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/film/frame_image.h"
#include "common/film/tile_geometry.h"

namespace sheaf::coordinator {

class EmitterColors {
 public:
  using Color = std::array<double, 3>;  // R, G and B.

  // Requires: an image with the layers of kinds of paths. It must outlive this object.
  explicit EmitterColors(const FrameImage& image);

  // Color in a pixel of the directly visible emission (Seen) or of all light (All). Components are
  // absolute values, since filters with negative lobes give some samples a negative weight.
  Color Seen(int32_t x, int32_t y) const { return ColorAt(seen_, x, y); }
  Color All(int32_t x, int32_t y) const { return ColorAt(all_, x, y); }
  const PixelRect& window() const { return window_; }

 private:
  using Planes = std::array<const std::vector<float>*, 3>;
  Color ColorAt(const Planes& planes, int32_t x, int32_t y) const;

  PixelRect window_;
  Planes all_, seen_;
};

}  // namespace sheaf::coordinator
