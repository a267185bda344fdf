// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ReplicateHalves: what the denoiser needs of the film beyond the image: for each pixel the mean of
// light over the replicates of even number (film_tile.h) and over the others, and the variances of
// both means. The two halves are independent, and both have the pixel's true value as their mean.
//
// The variance of a half is the ratio estimator's (pixel_replicates.h), from the half's own
// replicates, so it is unbiased where replicates have equal weights. Each half has guides of its
// own (denoised_output.h): noise of a guide, as where an edge crosses the pixel, is also noise of
// light, so that only the guides of the other half are independent of a half's light.
#pragma once

#include <array>
#include <cstddef>
#include <vector>

#include "common/film/denoised_output.h"
#include "common/film/film_tile.h"
#include "common/film/image_color.h"
#include "common/film/tile_geometry.h"

namespace sheaf {

class ReplicateHalves {
 public:
  // Planes are row-major over the window.
  struct Half {
    std::array<std::vector<float>, 3> mean, variance;  // R, G, B in the image's primaries.
    std::vector<float> replicate_count;  // Replicates with samples; fewer than 2: no variance.
    std::array<std::vector<float>, kGuideCount> guides;  // Means; of depth, over hits of surfaces.
  };

  // Allocates memory at the first tile: 124 bytes a pixel.
  explicit ReplicateHalves(PixelRect window) : window_(window) {}

  // Requires: the tile lies in the window, has the denoised output, and `color` is the image's.
  // Thread safety: none.
  void DevelopTile(const FilmTile& sums, const ImageColor& color);
  // Adds the light of an independent film of the same window, as light passes have it: means and
  // variances add, the smaller number of replicates counts, and guides stay.
  // Requires: neither is empty.
  void Add(const ReplicateHalves& other);

  const PixelRect& window() const { return window_; }
  bool empty() const { return even_share_.empty(); }
  const Half& half(size_t index) const { return halves_[index]; }
  // The even half's share of the pixel's weight: the image is share * even + (1 - share) * odd.
  const std::vector<float>& even_share() const { return even_share_; }

 private:
  void Allocate();

  PixelRect window_;
  std::array<Half, 2> halves_;
  std::vector<float> even_share_;
};

}  // namespace sheaf
