// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// An upper bound of an image's error that holds with a stated probability for any scene, not only
// for errors that are nearly normal. It requires samples between 0 and a known maximum.
//
//     tiles' sums > CertificatePlanes > CertifiedError > UpperBoundOfMean
//
// The bounded error is the expected relMSE: the mean over pixels and R, G, B of
// variance / (truth^2 + (0.1 m)^2), where m is the image's true mean. Replicates are independent
// and identically distributed (film_tile.h). With eight of them v = (their variance) / 16 has the
// variance of the pixel's mean as its expectation. With the other eight, the product q of two means
// of four has truth^2 as its expectation, is not negative, and is independent of v. Because 1 / (q
// + f^2) is convex in q, Jensen's inequality gives, for any f <= 0.1 m,
//
//     E[v / (q + f^2)] >= variance / (truth^2 + (0.1 m)^2).
//
// The left sides of all pixels are independent, between 0 and a known maximum, and their mean is
// observed. They have different distributions, so the bound of their mean is a bet with stakes that
// are fixed beforehand (UpperBoundOfMean). f is a lower bound of 0.1 m of the same kind.
//
// The bound holds at all sample counts of an image at once: the probability of a miss is divided
// among them (MissProbabilityAt), so a frame may stop where the bound is small enough.
// Sources: Waudby-Smith and Ramdas 2024, "Estimating Means of Bounded Random Variables by Betting";
// Ville 1939 for the inequality; docs/adr/0230 for the proof and its price.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/film/film_tile.h"
#include "common/film/tile_geometry.h"

namespace sheaf {

// The probability that a certified bound is missed at any sample count of an image.
inline constexpr double kCertificateMissProbability = 0.05;

// Sample counts at which a rule may end a frame: 16, 32, 48, 64, 96, 128, 192 ..., as replicates
// double, with one count between.
bool IsCertifiedStop(uint64_t samples);
// The least such count above `samples`.
uint64_t NextCertifiedStop(uint64_t samples);
// The part of kCertificateMissProbability that the image with this many samples per pixel has. The
// sum over all counts is at most the whole. Requires: a positive multiple of kReplicateCount.
double MissProbabilityAt(uint64_t samples);

// An upper bound of the mean of the expectations of independent values in [0, most], which may have
// different distributions. It is missed with at most the given probability. `most` when nothing
// less can be said.
//
// If the mean expectation is mu, the product over i of (1 + s (mu - x_i)), with 0 < s <= 1 / (most
// - mu), has an expectation of at most 1, by independence and the inequality of arithmetic and
// geometric means. So has any fixed mixture over s. By Markov's inequality it exceeds 1 / p with a
// probability of at most p: each mu for which it does is excluded. With t = s / (1 + s mu) the
// logarithm is sum log(1 - t x_i) - n log(1 - t mu), and one pass over the values serves all mu.
// Stakes t are powers of two from kLeastStake on.
double UpperBoundOfMean(std::span<const double> values, double most, double miss_probability);
// A lower bound of the mean of the expectations of independent values of at least 0; the stakes are
// powers of two times 1 / scale.
double LowerBoundOfMean(std::span<const double> values, double scale, double miss_probability);

// The variance and the square of each pixel, from which the bound follows. 32 bytes a pixel.
// Thread safety: none.
class CertificatePlanes {
 public:
  // most: the maximum of a sample in R, G and B; its minimum is 0. Allocates memory at the first
  // tile.
  CertificatePlanes(PixelRect window, std::array<double, 3> most) : window_(window), most_(most) {}

  // Takes or replaces the pixels of a tile. Requires: it lies in the window.
  void TakeTile(const FilmTile& sums);

  // 0 before the first tile.
  uint64_t memory_bytes() const {
    return pixels_.capacity() * sizeof(pixels_[0]) + samples_.capacity() * sizeof(samples_[0]);
  }

  struct Result {
    // Upper bound of the expected relMSE; 0 if there is none.
    double relative_mse_upper = 0;
    // The reason if there is none: a sentence part, "a pixel lacks samples".
    const char* why_not = "";
  };
  // The bound of the image as developed, if all pixels have `samples` samples.
  Result CertifiedError(uint64_t samples) const;

 private:
  // Planes of the window: v and q of R, G, B; the mean of R, G, B.
  static constexpr size_t kMean = 6, kPlaneCount = 7;
  void TakePixel(const FilmTile& sums, size_t from, size_t to);

  PixelRect window_;
  std::array<double, 3> most_;
  std::vector<std::array<float, kPlaneCount>> pixels_;
  std::vector<uint32_t> samples_;  // Per pixel; kUnusable where the replicates cannot be used.
  static constexpr uint32_t kUnusable = UINT32_MAX;
};

}  // namespace sheaf
