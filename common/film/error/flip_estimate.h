// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Estimates the perceived difference between an image and the converged one, without a reference.
//
// The replicates of even number (film_tile.h) have the mean a, the others b, and the image is their
// mean. a and b have independent errors of the same distribution, so e = (a - b) / 2 is distributed
// like the image's own error: FLIP(image, image + e) estimates FLIP(truth, image). The image
// replaces the truth although it has noise itself, which masks part of e: estimates are some
// percent too small (docs/adr/0037 has figures). If light is so rare that most pixels have not
// sampled it, they are much too small, like every estimate from samples.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "common/film/film_tile.h"
#include "common/film/frame_image.h"

namespace sheaf {

// The e above for each pixel of an image, in its colors.
class ErrorSample {
 public:
  // Allocates memory at the first tile.
  explicit ErrorSample(PixelRect window) : window_(window) {}

  // If a and b have different counts, e is scaled to the variance of the image's error; it stays 0
  // if one of them has no samples.
  // Requires: the tile lies in the window, and `color` is the image's.
  void DevelopTile(const FilmTile& sums, const ImageColor& color);
  // Adds the errors of an independent image of the same window that is added to this one's.
  void Add(const ErrorSample& other);
  // Row-major over the window; empty before the first tile.
  const std::array<std::vector<float>, 3>& planes() const { return planes_; }

 private:
  PixelRect window_;
  std::array<std::vector<float>, 3> planes_;
};

// The mean FLIP (flip.h) over the image in the view sRGB: no exposure, no curve but sRGB's. Takes
// some 0.2 microseconds of one processor per pixel. None if a pixel has fewer than two samples, or
// the image's primaries are degenerate.
// Requires: `error` includes all tiles of the image.
std::optional<double> EstimateFlip(const FrameImage& image, const ErrorSample& error);

}  // namespace sheaf
