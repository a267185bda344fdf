// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/error_curve.h"

#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"

namespace sheaf::coordinator {

std::string FormatErrorCurve(std::span<const RoundRecord> rounds, int64_t pixel_count) {
  std::string text;
  for (const RoundRecord& round : rounds) {
    const double samples =
        static_cast<double>(round.sample_count) / static_cast<double>(pixel_count);
    absl::StrAppendFormat(&text, "%s%.6g %.6g %.6g", text.empty() ? "" : ", ", samples,
                          round.relative_mse, round.relative_mse_upper);
  }
  return text;
}

std::vector<ErrorPoint> ParseErrorCurve(absl::string_view text) {
  std::vector<ErrorPoint> points;
  for (const absl::string_view part : absl::StrSplit(text, ", ")) {
    const std::vector<absl::string_view> words = absl::StrSplit(part, ' ');
    ErrorPoint& point = points.emplace_back();
    if (words.size() != 3 || !absl::SimpleAtod(words[0], &point.samples) ||
        !absl::SimpleAtod(words[1], &point.relative_mse) ||
        !absl::SimpleAtod(words[2], &point.relative_mse_upper)) {
      return {};
    }
  }
  return points;
}

}  // namespace sheaf::coordinator
