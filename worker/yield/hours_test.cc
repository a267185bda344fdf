// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/yield/hours.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "absl/strings/str_cat.h"

namespace sheaf::worker {
namespace {

// 2024-01-01 is a Monday. day: 0 is Monday.
absl::CivilMinute At(int day, int hour, int minute = 0) {
  return absl::CivilMinute(2024, 1, 1 + day, hour, minute);
}

bool Contains(const std::string& hours, absl::CivilMinute time) {
  const absl::StatusOr<WorkingHours> parsed = WorkingHours::Parse(hours);
  EXPECT_TRUE(parsed.ok()) << parsed.status();
  return parsed.ok() && parsed->Contains(time);
}

TEST(WorkingHoursTest, AllHoursUnlessSomeAreNamed) {
  EXPECT_TRUE(WorkingHours().Contains(At(0, 0)));
  EXPECT_TRUE(WorkingHours().Contains(At(6, 23, 59)));
}

TEST(WorkingHoursTest, ARangeHasItsFirstMinuteAndNotItsLast) {
  EXPECT_FALSE(Contains("09:30-17:00", At(2, 9, 29)));
  EXPECT_TRUE(Contains("09:30-17:00", At(2, 9, 30)));
  EXPECT_TRUE(Contains("9:30-17:00", At(2, 16, 59)));
  EXPECT_FALSE(Contains("09:30-17:00", At(2, 17, 0)));
  EXPECT_TRUE(Contains("00:00-24:00", At(2, 23, 59)));
}

TEST(WorkingHoursTest, ANightBelongsToTheDayOnWhichItBegins) {
  for (int day = 0; day < 7; ++day) {
    EXPECT_TRUE(Contains("19:00-07:00", At(day, 23)));
    EXPECT_TRUE(Contains("19:00-07:00", At(day, 0)));
    EXPECT_TRUE(Contains("19:00-07:00", At(day, 6, 59)));
    EXPECT_FALSE(Contains("19:00-07:00", At(day, 7)));
    EXPECT_FALSE(Contains("19:00-07:00", At(day, 18, 59)));
  }
  EXPECT_TRUE(Contains("Fri/19:00-07:00", At(4, 23)));
  EXPECT_TRUE(Contains("Fri/19:00-07:00", At(5, 6)));
  EXPECT_FALSE(Contains("Fri/19:00-07:00", At(4, 6)));
  EXPECT_FALSE(Contains("Fri/19:00-07:00", At(5, 23)));
  // From Sunday to Monday.
  EXPECT_TRUE(Contains("Sun/22:00-02:00", At(0, 1)));
}

TEST(WorkingHoursTest, DaysAndUnions) {
  EXPECT_TRUE(Contains("Sat-Sun", At(5, 0)));
  EXPECT_TRUE(Contains("sat-sun", At(6, 23, 59)));
  EXPECT_FALSE(Contains("Sat-Sun", At(0, 0)));
  EXPECT_TRUE(Contains("Fri-Mon", At(0, 12)));
  EXPECT_FALSE(Contains("Fri-Mon", At(1, 12)));
  EXPECT_TRUE(Contains("Wed", At(2, 12)));
  const std::string hours = "Mon-Fri/20:00-06:00,12:00-13:00,Sat-Sun";
  EXPECT_TRUE(Contains(hours, At(1, 12, 30)));
  EXPECT_FALSE(Contains(hours, At(1, 13)));
  EXPECT_TRUE(Contains(hours, At(5, 15)));
  EXPECT_FALSE(Contains(hours, At(0, 6)));
}

TEST(WorkingHoursTest, OtherTextsAreRefusedByName) {
  for (const std::string text : {"",
                                 "19",
                                 "19-7",
                                 "19:00",
                                 "19:00-",
                                 "-07:00",
                                 "25:00-07:00",
                                 "19:60-07:00",
                                 "24:01-07:00",
                                 "07:00-07:00",
                                 "24:00-07:00",
                                 "Sat-",
                                 "Sat-Sunday",
                                 "Fryday/19:00-07:00",
                                 "Sat/",
                                 "/",
                                 "19:00-07:00,",
                                 "1900-0700",
                                 "+1:00-07:00",
                                 " 19:00-07:00",
                                 "19:0-07:00",
                                 "019:00-07:00"}) {
    const absl::StatusOr<WorkingHours> parsed = WorkingHours::Parse(text);
    EXPECT_EQ(parsed.status().code(), absl::StatusCode::kInvalidArgument) << text;
  }
  EXPECT_THAT(WorkingHours::Parse("Sat-Sun,7-9").status().message(),
              ::testing::HasSubstr("\"7-9\" is no range of hours"));
  std::string many = "12:00-13:00";
  for (int i = 0; i < 64; ++i) absl::StrAppend(&many, ",12:00-13:00");
  EXPECT_FALSE(WorkingHours::Parse(many).ok());
}

}  // namespace
}  // namespace sheaf::worker
