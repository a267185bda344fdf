// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/frame_range.h"

#include <set>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace sheaf::cli {
namespace {

constexpr int32_t kFrameNumberMax = 99'999'999;

// Numbers above kFrameNumberMax become kFrameNumberMax + 1.
bool ParseNumber(const std::string& text, int32_t* number) {
  if (text.empty() || text.find_first_not_of("0123456789") != std::string::npos) return false;
  if (!absl::SimpleAtoi(text, number) || *number > kFrameNumberMax) *number = kFrameNumberMax + 1;
  return true;
}

// Adds one item: "A", "A-B" or "A-BxS".
absl::Status AddItem(const std::string& item, std::set<int32_t>* numbers) {
  const size_t dash = item.find('-');
  const size_t times = item.find('x', dash == std::string::npos ? 0 : dash);
  const bool has_step = times != std::string::npos;
  const std::string first_text = item.substr(0, dash);
  const std::string last_text =
      dash == std::string::npos ? item : item.substr(dash + 1, has_step ? times - dash - 1 : times);
  int32_t first = 0, last = 0, step = 1;
  if (!ParseNumber(first_text, &first) || !ParseNumber(last_text, &last) ||
      (has_step && !ParseNumber(item.substr(times + 1), &step))) {
    return absl::InvalidArgumentError(absl::StrCat(
        "frame range \"", item, "\": expected a number, A-B or A-BxSTEP, as in 1-24 or 1-100x5"));
  }
  for (const int32_t number : {first, last, step}) {
    if (number <= kFrameNumberMax) continue;
    return absl::InvalidArgumentError(
        absl::StrCat("frame range \"", item, "\": numbers may be at most ", kFrameNumberMax));
  }
  if (last < first) {
    return absl::InvalidArgumentError(
        absl::StrCat("frame range \"", item, "\": ends before it begins"));
  }
  if (step < 1) {
    return absl::InvalidArgumentError(absl::StrCat("frame range \"", item, "\": step 0"));
  }
  for (int64_t number = first; number <= last; number += step) {
    numbers->insert(static_cast<int32_t>(number));
    if (numbers->size() > kFramesMax) {
      return absl::InvalidArgumentError(absl::StrCat("frame range \"", item, "\": more than ",
                                                     kFramesMax,
                                                     " frames; submit them as several jobs"));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<int32_t>> ParseFrameRange(const std::string& text) {
  std::set<int32_t> numbers;
  const std::vector<std::string> items = absl::StrSplit(text, ',');
  for (const std::string& item : items) {
    if (absl::Status status = AddItem(item, &numbers); !status.ok()) return status;
  }
  return std::vector<int32_t>(numbers.begin(), numbers.end());
}

std::string FormatFrameRange(const std::vector<int32_t>& numbers) {
  std::string text;
  for (size_t first = 0, last = 0; first < numbers.size(); first = ++last) {
    while (last + 1 < numbers.size() && numbers[last + 1] == numbers[last] + 1) ++last;
    absl::StrAppend(&text, text.empty() ? "" : ",", numbers[first]);
    if (last > first) absl::StrAppend(&text, last == first + 1 ? "," : "-", numbers[last]);
  }
  return text;
}

bool IsPattern(const std::string& path) {
  return path.find('#', path.rfind('/') + 1) != std::string::npos;
}

std::string ExpandPattern(const std::string& pattern, int32_t frame_number) {
  const size_t last = pattern.rfind('#');
  if (last == std::string::npos) return pattern;
  size_t first = last;
  while (first > 0 && pattern[first - 1] == '#') --first;
  std::string number = absl::StrCat(frame_number);
  const size_t width = last - first + 1;
  if (number.size() < width) number.insert(0, width - number.size(), '0');
  return absl::StrCat(pattern.substr(0, first), number, pattern.substr(last + 1));
}

}  // namespace sheaf::cli
