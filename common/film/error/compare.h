// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// How far a picture is from a reference: one number for the whole, and a map of where it is off by
// more than noise explains.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/frame_picture.h"
#include "common/film/tile_geometry.h"

namespace sheaf {

// Over the channels R, G, B of all pixels, in double; x is the image, r the reference.
struct Comparison {
  double mse = 0;           // mean (x - r)^2.
  double relative_mse = 0;  // mean (x - r)^2 / (r^2 + (0.1 m)^2), m the mean of r; 0/0 counts as 0.
  double reference_mean = 0, image_mean = 0;
  // Mean of the image over mean of the reference for R, G, B; 1 where both are 0, infinite where
  // only the reference is.
  std::array<double, 3> mean_ratio{};
  double share_differing = 0;  // Of the pixels, those with different bits in R, G or B.
  double max_abs_difference = 0;
  uint64_t nonfinite_count =
      0;  // Values of either that are not finite; left out of all but the share.
};
// Errors: kInvalidArgument where the windows have different sizes, the primaries differ, or R, G or
// B is missing.
absl::StatusOr<Comparison> ComparePictures(const FramePicture& reference,
                                           const FramePicture& image);

// Of which light FLIP (flip.h) is asked for.
enum class FlipRange {
  kScreen,  // LDR-FLIP of the pictures as the view sRGB shows them: no exposure, light above 1 cut.
  kAll,     // HDR-FLIP: at all exposures that show something of the reference; slow.
};
// Mean FLIP over the pixels. Errors: as ComparePictures; also where the primaries are degenerate.
absl::StatusOr<double> PerceivedDifference(const FramePicture& reference, const FramePicture& image,
                                           FlipRange range);

// What a tile-by-tile comparison allows.
struct TileDeviationLimits {
  int32_t tile_size_px = 16;
  double standard_errors_max = 5;  // K.
  double mean_share_max = 0.015;   // Of the reference's tile mean, allowed beyond noise.
  // Samples a pixel of the image over those of the reference: a reference whose noise is not
  // recorded is taken to have the image's variance times this. 0: the reference has converged.
  double samples_ratio = 0;
  size_t worst_count_max = 10;
};
// The mean of one channel of one tile. excess = (|image - reference| - what mean_share_max
// allows) / standard_error, infinite where there is no noise to excuse a difference; above
// standard_errors_max it counts as deviating.
struct TileDeviation {
  PixelRect rect;
  size_t channel = 0;  // 0..2 = R, G, B.
  double image_mean = 0, reference_mean = 0, standard_error = 0, excess = 0;
};
struct TileDeviations {
  size_t tile_count = 0;
  size_t deviating_count = 0;        // Tiles with at least one deviating channel.
  std::vector<TileDeviation> worst;  // One a tile, by descending excess, deviating or not.
};
// Compares means of tiles, aligned to the image's window. The standard error of a mean is that of
// the channels stderr.R, .G, .B of the image, pixels taken as independent. Errors: as
// ComparePictures; also where the image has no channels stderr.*.
absl::StatusOr<TileDeviations> FindTileDeviations(const FramePicture& reference,
                                                  const FramePicture& image,
                                                  const TileDeviationLimits& limits);

// image - reference in R, G, B, signed, over the image's window.
// Errors: as ComparePictures.
absl::StatusOr<FramePicture> DifferencePicture(const FramePicture& reference,
                                               const FramePicture& image);

}  // namespace sheaf
