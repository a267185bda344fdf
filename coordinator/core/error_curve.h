// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ErrorCurve: how an image's error fell, as its file tells it (docs/outputs.md). Without times: a
// image's file is the same whoever rendered it, and however fast.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "absl/strings/string_view.h"
#include "coordinator/core/sample_rounds.h"

namespace sheaf::coordinator {

inline constexpr char kErrorCurveKey[] = "errorCurve";  // In an image's metadata.

struct ErrorPoint {
  double samples = 0;  // Per pixel, on average.
  double relative_mse = 0;
  double relative_mse_upper = 0;  // RoundDecision's.
};

// "SAMPLES ERROR UPPER, ..." of the rounds, with six digits.
std::string FormatErrorCurve(std::span<const RoundRecord> rounds, int64_t pixel_count);
// The points of such a text, to six digits; empty where the text is no such curve.
std::vector<ErrorPoint> ParseErrorCurve(absl::string_view text);

}  // namespace sheaf::coordinator
