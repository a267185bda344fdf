// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/surroundings/local_time.h"

#include <time.h>
#include <unistd.h>

#include <cstdlib>
#include <string_view>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/base/log.h"
#include "common/base/printable.h"

namespace sheaf {
namespace {

// The name with which absl reads localtime_r(3) and mktime(3).
constexpr char kLibraryZone[] = "libc:localtime";
constexpr char kZoneFolder[] = "/usr/share/zoneinfo";  // The C library's, unless TZDIR is set.
constexpr int kHoursMax = 167;                         // A week, as extended rules allow.

// Reads the rules of POSIX.1-2017, 8.3, TZ: each function takes what it reads off the front.
class Rule {
 public:
  explicit Rule(std::string_view text) : text_(text) {}

  bool IsGood() {
    if (!Name() || !Offset(kHoursMax)) return false;
    if (text_.empty()) return true;
    if (!Name()) return false;
    if (!text_.empty() && text_.front() != ',' && !Offset(kHoursMax)) return false;
    return text_.empty() || (Day() && Day() && text_.empty());
  }

 private:
  bool Take(char c) {
    if (text_.empty() || text_.front() != c) return false;
    text_.remove_prefix(1);
    return true;
  }
  bool Number(int min, int max) {
    size_t digits = 0;
    int value = 0;
    for (; digits < text_.size() && absl::ascii_isdigit(text_[digits]) && value <= max; ++digits) {
      value = 10 * value + (text_[digits] - '0');
    }
    text_.remove_prefix(digits);
    return digits > 0 && value >= min && value <= max;
  }
  // At least three letters, or more kinds of characters in angle brackets.
  bool Name() {
    const bool quoted = Take('<');
    size_t size = 0;
    while (size < text_.size() && (absl::ascii_isalpha(text_[size]) ||
                                   (quoted && (absl::ascii_isdigit(text_[size]) ||
                                               text_[size] == '+' || text_[size] == '-')))) {
      ++size;
    }
    text_.remove_prefix(size);
    return size >= 3 && (!quoted || Take('>'));
  }
  bool Offset(int hours_max) {
    if (!Take('-')) Take('+');
    if (!Number(0, hours_max)) return false;
    return !Take(':') || (Number(0, 59) && (!Take(':') || Number(0, 59)));
  }
  // ",M3.2.0/2", ",J60" or ",59".
  bool Day() {
    if (!Take(',')) return false;
    if (Take('M')) {
      if (!Number(1, 12) || !Take('.') || !Number(1, 5) || !Take('.') || !Number(0, 6))
        return false;
    } else if (!(Take('J') ? Number(1, 365) : Number(0, 365))) {
      return false;
    }
    return !Take('/') || Offset(kHoursMax);
  }

  std::string_view text_;
};

std::string_view WithoutColon(std::string_view tz) {
  return tz.substr(tz.starts_with(':') ? 1 : 0);
}

bool IsZoneFile(const std::string& name) {
  if (name.front() == '/') return ::access(name.c_str(), R_OK) == 0;
  const char* const folder = std::getenv("TZDIR");
  const std::string path =
      absl::StrCat(folder != nullptr && *folder != '\0' ? folder : kZoneFolder, "/", name);
  return ::access(path.c_str(), R_OK) == 0;
}

}  // namespace

std::string WhyNoZone(const std::string& tz) {
  const std::string name(WithoutColon(tz));
  if (name.empty() || IsZoneFile(name) || Rule(name).IsGood()) return "";
  return absl::StrCat("TZ=", Printable(tz),
                      ": there is no such time zone, so times are read and shown in UTC; set a "
                      "name as Europe/Berlin (package tzdata) or a rule as JST-9");
}

absl::TimeZone LocalZone() {
  static const absl::TimeZone zone = [] {
    const char* const tz = std::getenv("TZ");
    if (tz == nullptr) return absl::LocalTimeZone();
    const std::string why = WhyNoZone(tz);
    if (!why.empty()) LogWarning(why);
    if (!why.empty() || !Rule(WithoutColon(tz)).IsGood()) return absl::LocalTimeZone();
    ::tzset();
    absl::TimeZone library = absl::UTCTimeZone();
    absl::LoadTimeZone(kLibraryZone, &library);
    return library;
  }();
  return zone;
}

absl::Time FromLocal(absl::CivilSecond clock, absl::TimeZone zone) {
  const absl::Time as_utc = absl::FromCivil(clock, absl::UTCTimeZone());
  const auto with_offset_at = [&](absl::Time time) {
    return as_utc - absl::Seconds(zone.At(time).offset);
  };
  // Offsets are less than a day, and change less than once in two days.
  const absl::Time before = with_offset_at(as_utc - absl::Hours(24));
  const absl::Time after = with_offset_at(as_utc + absl::Hours(24));
  if (absl::ToCivilSecond(before, zone) == clock) return before;
  if (absl::ToCivilSecond(after, zone) == clock) return after;
  return before;
}

}  // namespace sheaf
