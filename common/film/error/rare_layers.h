// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Which layers the rare bright samples of unreliable tiles are in: the light groups or the kinds of
// light paths (FilmOutputs) that make their errors unreliable. How well it tells: docs/adr/0040.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/film/frame_picture.h"

namespace sheaf {

struct LayerCount {
  std::string layer;
  uint32_t tile_count = 0;
  friend bool operator==(const LayerCount&, const LayerCount&) = default;
};

// Of each tile one layer, counted; those of most tiles first. A sample that is much brighter than
// others stands out in its layer from the pixels about. So the layer to blame is that which has
// most of the squared differences from the mean of the 3 x 3 pixels about, where each pixel counts
// as its own differences say how they are shared, times its squared standard error. Light that
// differs from pixel to pixel for other reasons, as at the edges of shadows, has no error and does
// not count. Empty where the picture has no layers. tiles: within the picture's window.
std::vector<LayerCount> RareLayers(const FramePicture& picture, std::span<const PixelRect> tiles);

}  // namespace sheaf
