// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/quote/deadline.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "common/base/surroundings/local_time.h"
#include "coordinator/core/job/work_left.h"

namespace sheaf::cli {
namespace {

// With the day, if it is not today.
std::string ClockText(absl::Time time, absl::Time now, absl::TimeZone zone) {
  const bool is_today = absl::ToCivilDay(time, zone) == absl::ToCivilDay(now, zone);
  return absl::FormatTime(is_today ? "%H:%M" : "%Y-%m-%d %H:%M", time, zone);
}

bool ParseClock(const char* format, const std::string& text, absl::TimeZone zone,
                absl::Time* time) {
  absl::Time as_utc;
  std::string error;
  if (!absl::ParseTime(format, text, absl::UTCTimeZone(), &as_utc, &error)) return false;
  *time = FromLocal(absl::ToCivilSecond(as_utc, absl::UTCTimeZone()), zone);
  return true;
}

std::string ThreadsText(const Banded& cpu_seconds, double seconds) {
  const auto threads = [seconds](double cpu) {
    return static_cast<int64_t>(
        std::max(1.0, std::ceil(cpu / (seconds * coordinator::kUsualThreadUse))));
  };
  return absl::StrCat(threads(cpu_seconds.value), " threads (", threads(cpu_seconds.low), " to ",
                      threads(cpu_seconds.high), ")");
}

}  // namespace

absl::StatusOr<absl::Time> ParseDeadline(const std::string& text, absl::Time now,
                                         absl::TimeZone zone) {
  absl::Time time;
  std::string error;
  const std::string today = absl::FormatTime("%Y-%m-%d ", now, zone);
  if (ParseClock("%Y-%m-%d %H:%M", today + text, zone, &time)) {
    if (time > now) return time;
    const absl::CivilDay tomorrow = absl::ToCivilDay(now, zone) + 1;
    ParseClock("%Y-%m-%d %H:%M", absl::StrCat(absl::FormatCivilTime(tomorrow), " ", text), zone,
               &time);
    return time;
  }
  if (!ParseClock("%Y-%m-%d %H:%M", text, zone, &time) &&
      !ParseClock("%Y-%m-%dT%H:%M", text, zone, &time) &&
      !absl::ParseTime(absl::RFC3339_full, text, zone, &time, &error)) {
    return absl::InvalidArgumentError(
        absl::StrCat("--deadline \"", text,
                     "\": is not a time; write for example 18:00 or \"2026-05-04 18:00\""));
  }
  if (time <= now) {
    return absl::InvalidArgumentError(
        absl::StrCat("--deadline \"", text, "\": has passed; name a later time"));
  }
  return time;
}

const QuoteRow* RowOfJob(const Quote& quote, double target_error) {
  for (const QuoteRow& row : quote.rows) {
    const bool is_own =
        target_error > 0 ? row.target_error == target_error : row.samples_given.has_value();
    if (is_own) return &row;
  }
  return nullptr;
}

std::string JudgeDeadline(absl::Time deadline, absl::Time now, absl::TimeZone zone,
                          const QuoteRow& row, int thread_count) {
  const double left = absl::ToDoubleSeconds(deadline - now);
  const std::string text = absl::StrCat("deadline ", ClockText(deadline, now, zone), ": ");
  const std::string needs =
      absl::StrCat("alone, the job needs ", ThreadsText(row.cpu_seconds, left), " until then");
  if (row.wall_seconds.value <= 0) return absl::StrCat(text, "no workers are connected; ", needs);
  const std::string ends =
      absl::StrCat("between ", ClockText(now + absl::Seconds(row.wall_seconds.low), now, zone),
                   " and ", ClockText(now + absl::Seconds(row.wall_seconds.high), now, zone),
                   " on ", thread_count, " threads in 8 of 10 cases");
  if (row.wall_seconds.high <= left) return absl::StrCat(text, "made; ends ", ends);
  if (row.wall_seconds.low <= left) {
    return absl::StrCat(text, "at risk; ends ", ends, "; ", needs);
  }
  return absl::StrCat(text, "missed unless workers come; ends ", ends, "; ", needs);
}

}  // namespace sheaf::cli
