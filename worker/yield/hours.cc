// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/yield/hours.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"

namespace sheaf::worker {
namespace {

constexpr int kMinutesOfDay = 24 * 60;
constexpr const char* kDays[] = {"mon", "tue", "wed", "thu", "fri", "sat", "sun"};

std::optional<int> ParseDay(const std::string& text) {
  const char* const* found =
      std::find(std::begin(kDays), std::end(kDays), absl::AsciiStrToLower(text));
  if (found == std::end(kDays)) return std::nullopt;
  return static_cast<int>(found - std::begin(kDays));
}

// "Sat" or "Fri-Mon" as bits.
std::optional<uint8_t> ParseDays(const std::string& text) {
  const std::pair<std::string, std::string> ends = absl::StrSplit(text, absl::MaxSplits('-', 1));
  const std::optional<int> first = ParseDay(ends.first);
  const bool is_range = text.find('-') != std::string::npos;
  const std::optional<int> last = is_range ? ParseDay(ends.second) : first;
  if (!first || !last) return std::nullopt;
  unsigned days = 0;
  for (int day = *first;; day = (day + 1) % 7) {
    days |= 1u << day;
    if (day == *last) return static_cast<uint8_t>(days);
  }
}

// "7:05" as minutes since the day's start.
std::optional<int> ParseTime(const std::string& text) {
  const size_t colon = text.find(':');
  if (colon == std::string::npos || colon < 1 || colon > 2 || text.size() != colon + 3) {
    return std::nullopt;
  }
  const auto is_digit = [](char c) { return c == ':' || absl::ascii_isdigit(c); };
  int hours = 0, minutes = 0;
  if (!std::all_of(text.begin(), text.end(), is_digit) ||
      !absl::SimpleAtoi(text.substr(0, colon), &hours) ||
      !absl::SimpleAtoi(text.substr(colon + 1), &minutes)) {
    return std::nullopt;
  }
  const int time = 60 * hours + minutes;
  if (minutes >= 60 || time > kMinutesOfDay) return std::nullopt;
  return time;
}

int DayOf(absl::CivilDay day) { return static_cast<int>(absl::GetWeekday(day)); }

}  // namespace

absl::StatusOr<WorkingHours::Part> WorkingHours::ParsePart(const std::string& text) {
  Part part;
  std::string times = text;
  if (const size_t slash = text.find('/'); slash != std::string::npos || ParseDays(text)) {
    const std::optional<uint8_t> days = ParseDays(text.substr(0, slash));
    if (days) part.days = *days;
    times = slash == std::string::npos ? "00:00-24:00" : text.substr(slash + 1);
    if (!days) times = "";
  }
  const std::pair<std::string, std::string> ends = absl::StrSplit(times, absl::MaxSplits('-', 1));
  const std::optional<int> begin = ParseTime(ends.first), end = ParseTime(ends.second);
  if (!begin || !end || *begin == *end || *begin == kMinutesOfDay) {
    return absl::InvalidArgumentError(
        absl::StrCat("\"", text, "\" is no range of hours; write times as ",
                     "19:00-07:00, days as Sat-Sun, both as Mon-Fri/20:00-06:30"));
  }
  part.begin = *begin;
  part.end = *end;
  return part;
}

absl::StatusOr<WorkingHours> WorkingHours::Parse(const std::string& text) {
  WorkingHours hours;
  const std::vector<std::string> part_texts = absl::StrSplit(text, ',');
  for (const std::string& part_text : part_texts) {
    const absl::StatusOr<Part> part = ParsePart(part_text);
    if (!part.ok()) return part.status();
    if (hours.parts_.size() == kPartsMax) {
      return absl::InvalidArgumentError(
          absl::StrCat("more than ", kPartsMax, " ranges of hours; join some of them"));
    }
    hours.parts_.push_back(*part);
  }
  return hours;
}

bool WorkingHours::Contains(absl::CivilMinute time) const {
  const absl::CivilDay today(time);
  const int minute = static_cast<int>(time - absl::CivilMinute(today));
  const auto contains = [&](const Part& part) {
    const bool is_today = (part.days >> DayOf(today) & 1) != 0;
    const bool is_yesterday = (part.days >> DayOf(today - 1) & 1) != 0;
    if (part.end > part.begin) return is_today && minute >= part.begin && minute < part.end;
    return (is_today && minute >= part.begin) || (is_yesterday && minute < part.end);
  };
  return parts_.empty() || std::any_of(parts_.begin(), parts_.end(), contains);
}

}  // namespace sheaf::worker
