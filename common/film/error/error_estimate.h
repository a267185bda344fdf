// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The error of a picture, estimated from the spread of its pixels' replicates (pixel_replicates.h).
//
// The relative error divides by the square of a pixel's true value, which is not known. Its own
// mean will not do: a pixel with a rare bright sample has a large mean and a large error, and seems
// to be accurate. So the true value is predicted from the mean v of the pixel, of variance s^2, and
// the mean u of the 5 x 5 pixels about it without itself, as w u + (1 - w) v, where
// w = s^2 / (s^2 + d^2) and d^2 is the variance of those pixels' true values: that of their means
// less that of their noise. Of the square the variance of this prediction is taken off.
// Source: Lee 1980, "Digital Image Enhancement and Noise Filtering by Use of Local Statistics".
// On seven scenes at 16 and 64 samples, the sums are 0.91 to 1.07 of the true ones; with the
// pixel's own mean they are 0.06 to 1.02 (docs/adr/0034).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/film/frame_picture.h"
#include "common/film/tile_geometry.h"

namespace sheaf {

struct FrameError {
  // Predicted mean over pixels and R, G, B of stderr^2 / (truth^2 + (0.1 m)^2), m the mean of R, G
  // and B over the picture: what `sheaf compare` would measure against the converged picture.
  double relative_mse = 0;
  // One standard deviation of what would be measured about relative_mse, for the errors of the
  // estimate and for chance in the picture.
  double relative_mse_deviation = 0;
  // Of the frame's mean luminance; the three channels of a pixel are taken as fully correlated (an
  // upper bound), pixels as independent.
  double standard_error = 0;
  uint64_t nonfinite_count = 0;
  uint64_t sample_count = 0;  // Over all pixels; finite ones.
};

// Error over the picture as developed so far (pixels without samples are left out).
FrameError EstimateError(const FramePicture& picture);

// Of estimates of an error over their true values, what scenes differ in however many pixels they
// have: 0.94 to 1.10 between 16 and 100 samples (docs/adr/0034).
inline constexpr double kEstimateDeviation = 0.03;

// The errors of some pixels: of each, the mean over R, G, B of stderr^2 / (truth^2 + (0.1 m)^2).
struct ErrorSums {
  int64_t pixel_count = 0;
  double sum = 0, square_sum = 0;

  void Add(const ErrorSums& other) {
    pixel_count += other.pixel_count;
    sum += other.sum;
    square_sum += other.square_sum;
  }
  double RelativeMse() const {
    return pixel_count == 0 ? 0 : sum / static_cast<double>(pixel_count);
  }
  // As FrameError::relative_mse_deviation. Of normal errors, the squared error of a pixel has twice
  // its squared expectation as variance, and the estimate with 15 degrees of freedom 2 / 15 of it:
  // together less than twice the estimate's square, which is 17 / 15 of that. Where one bright
  // sample makes a pixel's error, the estimate rises with it, and the two are closer. With
  // kEstimateDeviation, which no number of pixels makes smaller.
  double Deviation() const;
};
// For each of the tiles, which lie in the picture's window.
std::vector<ErrorSums> EstimateTileErrors(const FramePicture& picture,
                                          std::span<const PixelRect> tiles);
// m above: the mean of R, G and B over the pixels that have samples. Where few have, it may be far
// from that of the picture: then the tiles' errors can be told with a better one.
double MeanOfPicture(const FramePicture& picture);
std::vector<ErrorSums> EstimateTileErrors(const FramePicture& picture,
                                          std::span<const PixelRect> tiles, double mean);

}  // namespace sheaf
