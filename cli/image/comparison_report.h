// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The results of sheaf compare as text, with a verdict on whether noise explains the difference.
#pragma once

#include <optional>
#include <string>

#include "common/film/error/compare.h"
#include "common/film/frame_image.h"

namespace sheaf::cli {

// relMSE predicted by an image's error bars, with its standard deviation.
struct ExpectedNoise {
  double relative_mse = 0, deviation = 0;
};
// nullopt if the image has no true error bars.
std::optional<ExpectedNoise> NoiseOf(const FrameImage& image);

// Variances of independent errors add up. A reference without error bars counts as noise-free.
std::optional<ExpectedNoise> NoiseOfDifference(const std::optional<ExpectedNoise>& reference,
                                               const std::optional<ExpectedNoise>& image);

// How many standard deviations above the expected relMSE still count as chance.
inline constexpr double kNoiseDeviationsMax = 3;

struct ComparisonReport {
  Comparison comparison;
  std::optional<ExpectedNoise> noise;  // The difference's; nullopt if the image has no error bars.
  double flip = 0;
  std::optional<double> hdr_flip;
  std::optional<TileDeviations> tiles;
  double tolerance = -1;  // Limit of relMSE; negative: none was given.
  std::string reference_digest, image_digest;
};

// "identical", "within noise", "beyond noise", or "unknown" if the image has no error bars.
const char* VerdictOf(const ComparisonReport& report);
// The report as lines of text; the last one is the verdict.
std::string FormatComparison(const ComparisonReport& report);

}  // namespace sheaf::cli
