// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The findings of sheaf compare as people read them, with a verdict: whether noise explains them.
#pragma once

#include <optional>
#include <string>

#include "common/film/error/compare.h"
#include "common/film/frame_picture.h"

namespace sheaf::cli {

// relMSE that the error bars of a picture foretell, with its standard deviation.
struct ExpectedNoise {
  double relative_mse = 0, deviation = 0;
};
// None where the picture has no true error bars.
std::optional<ExpectedNoise> NoiseOf(const FramePicture& picture);

// Independent errors add up. A reference without error bars is taken to have none.
std::optional<ExpectedNoise> NoiseOfDifference(const std::optional<ExpectedNoise>& reference,
                                               const std::optional<ExpectedNoise>& image);

// Deviations beyond the expected relMSE that chance is held to make.
inline constexpr double kNoiseDeviationsMax = 3;

struct ComparisonReport {
  Comparison comparison;
  std::optional<ExpectedNoise> noise;  // Of the difference; none: the image has no error bars.
  double flip = 0;
  std::optional<double> hdr_flip;
  std::optional<TileDeviations> tiles;
  double tolerance = -1;  // Of relMSE; negative: none was asked for.
  std::string reference_digest, image_digest;
};

// "identical", "within noise", "beyond noise", or "unknown" where the image has no error bars.
const char* VerdictOf(const ComparisonReport& report);
// Lines for people; the last one is the verdict.
std::string FormatComparison(const ComparisonReport& report);

}  // namespace sheaf::cli
