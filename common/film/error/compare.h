// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The difference between an image and a reference: one number for the whole image, and a list of
// tiles that deviate by more than noise explains.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/frame_image.h"
#include "common/film/tile_geometry.h"

namespace sheaf {

// Over the channels R, G, B of all pixels, in double; x is the image, r the reference.
struct Comparison {
  double mse = 0;           // mean (x - r)^2.
  double relative_mse = 0;  // mean (x - r)^2 / (r^2 + (0.1 m)^2), m the mean of r; 0/0 counts as 0.
  double reference_mean = 0, image_mean = 0;
  // Mean of the image over mean of the reference for R, G, B; 1 if both are 0, infinite if only the
  // reference is.
  std::array<double, 3> mean_ratio{};
  double fraction_differing = 0;  // Fraction of pixels with different bits in R, G or B.
  double max_abs_difference = 0;
  uint64_t nonfinite_count =
      0;  // Non-finite values of either; only fraction_differing includes them.
};
// Errors: kInvalidArgument if the windows have different sizes, the primaries differ, or R, G or B
// is missing.
absl::StatusOr<Comparison> CompareImages(const FrameImage& reference, const FrameImage& image);

// The range of light that FLIP (flip.h) considers.
enum class FlipRange {
  kScreen,  // LDR-FLIP of the images in the view sRGB: no exposure, clipped at 1.
  kAll,     // HDR-FLIP: at all exposures that show part of the reference; slow.
};
// Mean FLIP over the pixels.
// Errors: as CompareImages; also kInvalidArgument if the primaries are degenerate.
absl::StatusOr<double> PerceivedDifference(const FrameImage& reference, const FrameImage& image,
                                           FlipRange range);

// Tolerances of a tile-by-tile comparison.
struct TileDeviationLimits {
  int32_t tile_size_px = 16;
  double standard_errors_max = 5;  // K.
  // Allowed beyond noise, as a fraction of the reference's tile mean.
  double mean_fraction_max = 0.015;
  // Ratio of the image's samples per pixel to the reference's. The reference's own noise is not
  // recorded; its variance is taken to be the image's times this ratio. 0: the reference has
  // converged.
  double samples_ratio = 0;
  size_t worst_count_max = 10;
};
// One channel of one tile. excess = (|image - reference| - the tolerance by mean_fraction_max) /
// standard_error of the means; infinite if there is a difference and no noise. The tile deviates if
// excess is above standard_errors_max.
struct TileDeviation {
  PixelRect rect;
  size_t channel = 0;  // 0..2 = R, G, B.
  double image_mean = 0, reference_mean = 0, standard_error = 0, excess = 0;
};
struct TileDeviations {
  size_t tile_count = 0;
  size_t deviating_count = 0;        // Tiles with at least one deviating channel.
  std::vector<TileDeviation> worst;  // One per tile, by descending excess, deviating or not.
};
// Compares means of tiles, aligned to the image's window. The standard error of a mean follows from
// the image's channels stderr.R, .G, .B, treating pixels as independent.
// Errors: as CompareImages; also if the image has no channels stderr.*.
absl::StatusOr<TileDeviations> FindTileDeviations(const FrameImage& reference,
                                                  const FrameImage& image,
                                                  const TileDeviationLimits& limits);

// Signed image - reference in R, G, B, over the image's window. Errors: as CompareImages.
absl::StatusOr<FrameImage> DifferenceImage(const FrameImage& reference, const FrameImage& image);

}  // namespace sheaf
