// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The errors of pixels from the planes of a developed image, as described in error_estimate.h.
#pragma once

#include <array>
#include <vector>

#include "common/film/error/error_estimate.h"

namespace sheaf {

// The planes that errors are estimated from. The image must outlive the object.
struct ErrorPlanes {
  explicit ErrorPlanes(const FrameImage& image);
  // The mean of R, G and B over all pixels with samples.
  double Mean() const;

  std::array<const std::vector<float>*, 3> value, error;
  const std::vector<float>* samples;
  const std::vector<float>* nonfinite;
};

struct PixelError {
  double value = 0;  // Expected: mean over R, G, B of stderr^2 / (truth^2 + floor^2).
  // The part of `value` that is due to a single bright hit, and the largest value that its true
  // error may have (RareHits).
  double rare = 0, rare_max = 0;
};

// Errors of the pixels of `tile`, row-major; 0 for those without samples. mean: that of R, G and B
// over the image.
std::vector<PixelError> PixelErrors(const ErrorPlanes& planes, const FrameImage& image,
                                    const PixelRect& tile, double mean);

// If a pixel's deviation is at least this fraction of its value, a single hit is responsible: for
// two equal hits among sixteen replicates it is 0.68.
inline constexpr double kOneHitDeviationMin = 0.8;

// Pixels in which a single replicate hit something bright, for example at the silhouette of an
// emitter, where the neighborhood does not help, as it consists of emitter and background. The
// emitter may cover any fraction p of the pixel below the observed one, which is one sample of n:
// the true error is 1 / (n p)^2 times the estimated one, at most the error if the hit was pure
// luck. Given one hit, and Jeffreys' prior for the mean of a Poisson distribution, in which small
// fractions are frequent, as at the tails of pixel filters, n p has the density 2 / sqrt(pi) sqrt(n
// p) exp(-n p); so
//
//   P(error > x) = kScale (told / x)^kIndex for large x, kIndex = 3 / 4, kScale = 4 / (3 sqrt(pi)),
//
// where told is the estimated error. A sum of such errors is dominated by its largest. Errors
// beyond a high quantile of the largest are ignored as improbable; up to there each error has a
// variance of kIndex kScale / (2 - kIndex) told^kIndex x^(2 - kIndex). Source: Jeffreys 1946, "An
// Invariant Form for the Prior Probability in Estimation Problems".
class RareHits {
 public:
  // count: the number of such pixels, for expected rather than observed hits.
  void Add(size_t tile, const PixelError& error, double count = 1);
  // Adds to the sums of the tiles.
  void AddVariances(std::vector<ErrorSums>* tiles) const;

 private:
  static constexpr double kIndex = 0.75, kScale = 0.752253;
  struct Hit {
    size_t tile;
    double told;  // The sum over the pixels of the estimated errors to the power of kIndex.
    double error_max;
  };
  std::vector<Hit> hits_;
  double sum_ = 0;  // Sum of `told`.
};

// Sums over the pixels with samples. rare: receives the rare hits of the pixels, under this tile
// number.
ErrorSums SumErrors(const ErrorPlanes& planes, const FrameImage& image, const PixelRect& tile,
                    double mean, size_t tile_number, RareHits* rare);

}  // namespace sheaf
