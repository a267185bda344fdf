// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/frames/frame_range.h"

#include <algorithm>
#include <filesystem>
#include <set>
#include <system_error>

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

bool Exists(const std::string& path) {
  std::error_code ignored;  // A path that cannot be checked counts as absent.
  return std::filesystem::exists(path, ignored);
}

// The runs of at least run_min '#' in path[begin, end), each as the number of the path.
std::vector<FramePath> FindRuns(const std::string& path, size_t begin, size_t end, size_t run_min) {
  std::vector<FramePath> runs;
  for (size_t at = path.find('#', begin); at < end; at = path.find('#', at)) {
    const size_t width = std::min(path.find_first_not_of('#', at), path.size()) - at;
    if (width >= run_min) runs.push_back({path, at, width});
    at += width;
  }
  return runs;
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

std::string FramePath::Of(int32_t frame_number) const {
  if (!HasNumber()) return path;
  std::string number = absl::StrCat(frame_number);
  if (number.size() < width) number.insert(0, width - number.size(), '0');
  return absl::StrCat(path.substr(0, first), number, path.substr(first + width));
}

absl::StatusOr<FramePath> FindFrameNumber(const std::string& path, int32_t frame_number,
                                          size_t run_min) {
  const size_t name = path.rfind('/') + 1;
  if (const std::vector<FramePath> runs = FindRuns(path, name, path.size(), run_min);
      !runs.empty()) {
    return runs.back();
  }
  FramePath found{path};
  for (size_t begin = 0; begin < name; begin = path.find('/', begin) + 1) {
    const size_t end = path.find('/', begin);
    const std::vector<FramePath> runs = FindRuns(path, begin, end, run_min);
    FramePath folder = found;
    folder.path.resize(end);
    if (runs.empty() || Exists(folder.Of(frame_number))) continue;
    if (found.HasNumber()) {
      return absl::InvalidArgumentError(
          absl::StrCat(path,
                       ": # in several folders, none of which exists; write #### in the one "
                       "that has the frame's number, and make the others"));
    }
    found = runs.back();
  }
  return found;
}

absl::StatusOr<FramePath> FindInputFrameNumber(const std::string& path, int32_t frame_number) {
  std::vector<FramePath> runs = FindRuns(path, path.rfind('/') + 1, path.size(), 1);
  if (runs.size() < 2) return FindFrameNumber(path, frame_number);
  const FramePath last = runs.back();
  std::erase_if(runs, [&](const FramePath& run) { return !Exists(run.Of(frame_number)); });
  if (runs.size() < 2) return runs.empty() ? last : runs.front();
  return absl::InvalidArgumentError(
      absl::StrCat(path, ": which # is the frame's number is not clear: ", runs[0].Of(frame_number),
                   " and ", runs[1].Of(frame_number), " are both files; rename one of them"));
}

size_t LongestRun(const std::string& path) {
  size_t longest = 0;
  for (const FramePath& run : FindRuns(path, path.rfind('/') + 1, path.size(), 1)) {
    longest = std::max(longest, run.width);
  }
  return longest;
}

}  // namespace sheaf::cli
