// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/base/surroundings/local_time.h"

#include <gtest/gtest.h>
#include <time.h>

#include <cstdlib>

namespace sheaf {
namespace {

// LocalZone() reads TZ once: each zone in a process of its own.
#define EXPECT_LOCAL_TIME(tz, unix_seconds, expected)                                           \
  EXPECT_EXIT(                                                                                  \
      {                                                                                         \
        ::setenv("TZ", tz, 1);                                                                  \
        const absl::Time time = absl::FromUnixSeconds(unix_seconds);                            \
        const std::string text = absl::FormatTime("%Y-%m-%d %H:%M %z", time, LocalZone());      \
        const absl::Time back = FromLocal(absl::ToCivilSecond(time, LocalZone()), LocalZone()); \
        std::fprintf(stderr, "%s", text.c_str());                                               \
        std::exit(back == time ? 0 : 1);                                                        \
      },                                                                                        \
      testing::ExitedWithCode(0), expected)

constexpr int64_t kMarch = 1772521200;  // 2026-03-03 07:00 UTC.
constexpr int64_t kJuly = 1783062000;   // 2026-07-03 07:00 UTC.

TEST(LocalTimeTest, KnowsRulesOfPosix) {
  EXPECT_LOCAL_TIME("JST-9", kMarch, "2026-03-03 16:00 .0900");
  EXPECT_LOCAL_TIME("CET-1CEST,M3.5.0,M10.5.0/3", kMarch, "2026-03-03 08:00 .0100");
  EXPECT_LOCAL_TIME("CET-1CEST,M3.5.0,M10.5.0/3", kJuly, "2026-07-03 09:00 .0200");
  EXPECT_LOCAL_TIME("EST5EDT,M3.2.0,M11.1.0", kMarch, "2026-03-03 02:00 -0500");
  EXPECT_LOCAL_TIME("EST5EDT,M3.2.0,M11.1.0", kJuly, "2026-07-03 03:00 -0400");
  EXPECT_LOCAL_TIME("<+0530>-5:30", kJuly, "2026-07-03 12:30 .0530");
}

TEST(LocalTimeTest, KnowsNamesAndFiles) {
  EXPECT_LOCAL_TIME("Asia/Tokyo", kMarch, "2026-03-03 16:00 .0900");
  EXPECT_LOCAL_TIME(":/usr/share/zoneinfo/Asia/Tokyo", kMarch, "2026-03-03 16:00 .0900");
  EXPECT_LOCAL_TIME("", kMarch, "2026-03-03 07:00 .0000");
}

TEST(LocalTimeTest, WarnsOfUnknownZones) {
  EXPECT_LOCAL_TIME("Nowhere/Land", kMarch, "TZ=Nowhere/Land: there is no such time zone");
}

TEST(LocalTimeTest, TellsRulesFromOtherWords) {
  for (const char* good :
       {"UTC0", "JST-9", "EST5EDT", "<-03>3", "NZST-12NZDT,M9.5.0,M4.1.0/3", "IST-5:30",
        "CET-1CEST-2,J60,J300/25:30:10", "AAA0BBB,59/-2,300", "", ":", "UTC"}) {
    EXPECT_EQ(WhyNoZone(good), "") << good;
  }
  for (const char* bad :
       {"JST", "JST+", "J-9", "JST-9;", "EST5EDT,M3.2.0", "EST5EDT,M13.2.0,M1.1.0", "JST-999", "9",
        "<+09-9", "Berlin", "/nowhere/zone", "\xe9"}) {
    EXPECT_NE(WhyNoZone(bad), "") << bad;
  }
}

// Around the changes of a zone whose rules absl knows.
TEST(LocalTimeTest, ReadsClocksAsAbslDoes) {
  absl::TimeZone zone;
  ASSERT_TRUE(absl::LoadTimeZone("America/New_York", &zone));
  for (int64_t second = 1767225600; second < 1767225600 + 366 * 86400; second += 900) {
    const absl::CivilSecond clock = absl::ToCivilSecond(absl::FromUnixSeconds(second), zone);
    ASSERT_EQ(FromLocal(clock, zone), zone.At(clock).pre) << clock;
  }
  const absl::CivilSecond skipped(2026, 3, 8, 2, 30, 0), twice(2026, 11, 1, 1, 30, 0);
  EXPECT_EQ(FromLocal(skipped, zone), zone.At(skipped).pre);
  EXPECT_EQ(FromLocal(twice, zone), zone.At(twice).pre);
}

}  // namespace
}  // namespace sheaf
