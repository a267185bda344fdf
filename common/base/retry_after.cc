// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/retry_after.h"

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/string_view.h"
#include "absl/strings/strip.h"

namespace sheaf {
namespace {

constexpr absl::string_view kMark = "; retry after ";
constexpr absl::string_view kUnit = " s";
// A longer wait is not taken from a message.
constexpr double kWaitMaxSeconds = 3600;

}  // namespace

absl::Status RetryAfterError(const std::string& message, absl::Duration wait) {
  return absl::ResourceExhaustedError(
      absl::StrCat(message, kMark, absl::ToDoubleSeconds(wait), kUnit));
}

std::optional<absl::Duration> RetryAfterOf(const absl::Status& status) {
  if (!absl::IsResourceExhausted(status)) return std::nullopt;
  absl::string_view text = status.message();
  if (!absl::ConsumeSuffix(&text, kUnit)) return std::nullopt;
  const size_t mark = text.rfind(kMark);
  double seconds = 0;
  if (mark == absl::string_view::npos ||
      !absl::SimpleAtod(text.substr(mark + kMark.size()), &seconds) ||
      !(seconds > 0 && seconds <= kWaitMaxSeconds)) {
    return std::nullopt;
  }
  return absl::Seconds(seconds);
}

}  // namespace sheaf
