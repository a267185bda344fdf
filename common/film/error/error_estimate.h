// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Estimates the remaining error of an image from the spread of its replicates
// (pixel_replicates.h).
//
// The relative error divides by the square of a pixel's true value, which is unknown. The pixel's
// own mean is a bad substitute: a pixel with a rare bright sample has a large mean and a large
// error, and appears accurate. So the true value is predicted from the mean v of the pixel, of
// variance s^2, and the mean u of the 5 x 5 pixels around it without itself, as w u + (1 - w) v,
// where w = s^2 / (s^2 + d^2) and d^2 is the variance of those pixels' true values: the variance of
// their means less that of their noise. The variance of this prediction is subtracted from its
// square. Source: Lee 1980, "Digital Image Enhancement and Noise Filtering by Use of Local
// Statistics". On seven scenes at 16 and 64 samples, the estimated sums are 0.91 to 1.07 of the
// true ones; with the pixel's own mean they are 0.06 to 1.02 (docs/adr/0034).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "common/film/frame_image.h"
#include "common/film/tile_geometry.h"

namespace sheaf {

struct FrameError {
  // Predicted mean over pixels and R, G, B of stderr^2 / (truth^2 + (0.1 m)^2), with m the mean of
  // R, G and B over the image: the value that `sheaf compare` would measure against the converged
  // image.
  double relative_mse = 0;
  // One standard deviation of the measured value about relative_mse, including the errors of the
  // estimate and the noise of the image.
  double relative_mse_deviation = 0;
  // Standard error of the frame's mean luminance. The three channels of a pixel are taken as fully
  // correlated (an upper bound), pixels as independent.
  double standard_error = 0;
  uint64_t nonfinite_count = 0;
  uint64_t sample_count = 0;  // Over all pixels; finite samples only.
};

// Error over the image as developed so far (pixels without samples are ignored).
FrameError EstimateError(const FrameImage& image);

// Relative deviation between scenes of estimated over true errors, which remains for any number of
// pixels: ratios are 0.94 to 1.10 between 16 and 100 samples (docs/adr/0034).
inline constexpr double kEstimateDeviation = 0.03;

// The errors of some pixels: for each, the mean over R, G, B of stderr^2 / (truth^2 + (0.1 m)^2).
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
  // See FrameError::relative_mse_deviation. If errors are normal, the squared error of a pixel has
  // a variance of twice its squared expectation, and the estimate with 15 degrees of freedom 2 / 15
  // of it: together less than twice the estimate's square, which is 17 / 15 of that. If one bright
  // sample dominates a pixel's error, the estimate rises with it, and the two are closer. Includes
  // kEstimateDeviation, which does not shrink with the number of pixels.
  double Deviation() const;
};
// One entry per tile; the tiles lie in the image's window.
std::vector<ErrorSums> EstimateTileErrors(const FrameImage& image,
                                          std::span<const PixelRect> tiles);
// m above: the mean of R, G and B over the pixels that have samples. If few have, it may be far
// from the mean of the whole image: then estimate the tiles' errors with a better one.
double MeanOfImage(const FrameImage& image);
std::vector<ErrorSums> EstimateTileErrors(const FrameImage& image, std::span<const PixelRect> tiles,
                                          double mean);

}  // namespace sheaf
