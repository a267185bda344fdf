// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// How far a picture is from the converged one to the eye, without a reference.
//
// The replicates of even number (film_tile.h) have the mean a, the others b, and the picture is
// their mean. a and b have independent errors of the same distribution, so e = (a - b) / 2 is
// distributed as the picture's own error: FLIP(picture, picture + e) estimates FLIP(truth,
// picture). The picture stands for the truth although it has noise itself, which hides some of e:
// estimates are some percent too small (docs/adr/0037 has figures), and where light is so rare
// that most pixels have not met it, like every estimate from samples, they are much too small.
#pragma once

#include <array>
#include <optional>
#include <vector>

#include "common/film/film_tile.h"
#include "common/film/frame_picture.h"

namespace sheaf {

// The e above, of each pixel of a picture, in its colors.
class ErrorSample {
 public:
  // Takes memory when the first tile comes.
  explicit ErrorSample(PixelRect window) : window_(window) {}

  // Where a and b have different counts e is scaled to the variance of the picture's error; it is
  // left 0 where one of them has no samples. Requires: the tile lies in the window, and `color` is
  // the picture's.
  void DevelopTile(const FilmTile& sums, const PictureColor& color);
  // Row-major over the window; empty before the first tile.
  const std::array<std::vector<float>, 3>& planes() const { return planes_; }

 private:
  PixelRect window_;
  std::array<std::vector<float>, 3> planes_;
};

// The mean FLIP (flip.h) over the picture, as the view sRGB shows it: no exposure, no curve but
// sRGB's. Some 0.2 microseconds of one processor for each pixel. None where a pixel has fewer
// than two samples, or the picture's primaries are degenerate. Requires: `error` is of all of the
// picture's tiles.
std::optional<double> EstimateFlip(const FramePicture& picture, const ErrorSample& error);

}  // namespace sheaf
