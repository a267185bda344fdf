// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The errors of pixels from the planes of a developed picture; error_estimate.h says how.
#pragma once

#include <array>
#include <vector>

#include "common/film/error/error_estimate.h"

namespace sheaf {

// The planes that errors are estimated from, of a picture that outlives the object.
struct ErrorPlanes {
  explicit ErrorPlanes(const FramePicture& picture);
  // The mean of R, G and B over all pixels with samples.
  double Mean() const;

  std::array<const std::vector<float>*, 3> value, error;
  const std::vector<float>* samples;
  const std::vector<float>* nonfinite;
};

struct PixelError {
  double value = 0;  // Expected: mean over R, G, B of stderr^2 / (truth^2 + floor^2).
  // Of `value`, what one bright hit makes, and the most that it may be instead (RareHits).
  double rare = 0, rare_max = 0;
};

// Of the pixels of `tile`, row-major; 0 for those without samples. mean: the picture's, of R, G and
// B.
std::vector<PixelError> PixelErrors(const ErrorPlanes& planes, const FramePicture& picture,
                                    const PixelRect& tile, double mean);

// From this share of its value on, the deviation of a pixel is one hit's: of two equal ones among
// sixteen replicates it is 0.68 of it.
inline constexpr double kOneHitDeviationMin = 0.8;

// Pixels in which one replicate alone met something bright, at the rim of a lamp, say, where the
// pixels about are no guide, being lamp and wall. The pixel's share p of it may be any that is
// smaller than seen, and what was seen is of 1 / n of it: the error is 1 / (n p)^2 times the one
// that is told, up to what it is where all that was seen was luck. One hit, and Jeffreys' prior of
// the mean of a Poisson distribution, which has it that small shares are frequent, as at the tails
// of pixel filters, leave for n p the density 2 / sqrt(pi) sqrt(n p) exp(-n p); so
//
//   P(error > x) = kScale (told / x)^kIndex for large x, kIndex = 3 / 4, kScale = 4 / (3 sqrt(pi)).
//
// A sum of such errors is as large as its largest; what is beyond the largest's quantile is left to
// chance, and up to there each has a variance of kIndex kScale / (2 - kIndex) of
// told^kIndex x^(2 - kIndex).
// Source: Jeffreys 1946, "An Invariant Form for the Prior Probability in Estimation Problems".
class RareHits {
 public:
  // count: of such pixels, of what is expected and not of one that was seen.
  void Add(size_t tile, const PixelError& error, double count = 1);
  // To the sums of the tiles.
  void AddVariances(std::vector<ErrorSums>* tiles) const;

 private:
  static constexpr double kIndex = 0.75, kScale = 0.752253;
  struct Hit {
    size_t tile;
    double told;  // Summed over the pixels, each to the power of kIndex.
    double error_max;
  };
  std::vector<Hit> hits_;
  double sum_ = 0;  // Of `told`.
};

// Of the pixels with samples. rare: where those of the pixels are added to, for the tile of this
// number.
ErrorSums SumErrors(const ErrorPlanes& planes, const FramePicture& picture, const PixelRect& tile,
                    double mean, size_t tile_number, RareHits* rare);

}  // namespace sheaf
