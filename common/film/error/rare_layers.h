// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Finds the layers that contain the rare bright samples of unreliable tiles: the light groups or
// the kinds of paths (FilmOutputs) that make the tiles' error estimates unreliable.
// docs/adr/0040 has its accuracy.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/film/frame_image.h"

namespace sheaf {

struct LayerCount {
  std::string layer;
  uint32_t tile_count = 0;
  friend bool operator==(const LayerCount&, const LayerCount&) = default;
};

// Attributes each tile to one layer and counts the tiles per layer, most tiles first. A sample much
// brighter than others stands out in its layer from the neighboring pixels. So each pixel
// distributes its squared standard error over the layers in proportion to their squared differences
// from the mean of its 3 x 3 neighborhood; the layer with the largest total is responsible. Light
// that varies between pixels for other reasons, as at the edges of shadows, has no error and does
// not count. Empty if the image has no layers. tiles: within the image's window.
std::vector<LayerCount> RareLayers(const FrameImage& image, std::span<const PixelRect> tiles);

}  // namespace sheaf
