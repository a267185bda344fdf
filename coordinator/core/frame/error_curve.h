// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ErrorCurve: the course of an image's error over its samples, as text in the image's metadata
// (docs/outputs.md). It contains no times, so that the image's file does not depend on the workers
// or their speed.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"
#include "coordinator/core/frame/sample_rounds.h"

namespace sheaf::coordinator {

inline constexpr char kErrorCurveKey[] = "errorCurve";  // In an image's metadata.

struct ErrorPoint {
  double samples = 0;  // Per pixel, on average.
  double relative_mse = 0;
  double relative_mse_upper = 0;  // See RoundDecision.
};

// Formats the rounds as "SAMPLES ERROR UPPER, ...", with six digits.
std::string FormatErrorCurve(std::span<const RoundRecord> rounds, int64_t pixel_count);
// Parses such a text into points with six digits. Returns an empty list if the text is malformed.
std::vector<ErrorPoint> ParseErrorCurve(absl::string_view text);

}  // namespace sheaf::coordinator
