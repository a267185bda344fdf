// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/quote/deadline.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;

const absl::TimeZone kZone = absl::FixedTimeZone(7200);

absl::Time At(int day, int hour, int minute) {
  return absl::FromCivil(absl::CivilMinute(2026, 5, day, hour, minute), kZone);
}

TEST(DeadlineTest, ReadsTimes) {
  const absl::Time now = At(4, 15, 30);
  EXPECT_EQ(*ParseDeadline("18:00", now, kZone), At(4, 18, 0));
  EXPECT_EQ(*ParseDeadline("09:05", now, kZone), At(5, 9, 5)) << "tomorrow";
  EXPECT_EQ(*ParseDeadline("15:30", now, kZone), At(5, 15, 30));
  EXPECT_EQ(*ParseDeadline("2026-05-06 08:00", now, kZone), At(6, 8, 0));
  EXPECT_EQ(*ParseDeadline("2026-05-06T08:00", now, kZone), At(6, 8, 0));
  EXPECT_EQ(*ParseDeadline("2026-05-06T08:00:00+00:00", now, kZone), At(6, 10, 0));
  for (const char* text : {"", "soon", "25:00", "18", "2026-05-04 15:00", "2026-13-01 10:00"}) {
    EXPECT_THAT(ParseDeadline(text, now, kZone).status().message(), HasSubstr("--deadline"));
  }
}

TEST(DeadlineTest, JudgesByTheBand) {
  const absl::Time now = At(4, 15, 30);
  QuoteRow row;
  row.cpu_seconds = {3420, 3000, 4000};
  row.wall_seconds = {600, 540, 720};
  EXPECT_EQ(JudgeDeadline(At(4, 15, 45), now, kZone, row, 6),
            "deadline 15:45: made; ends between 15:39 and 15:42 on 6 threads in 8 of 10 cases");
  EXPECT_EQ(JudgeDeadline(At(4, 15, 40), now, kZone, row, 6),
            "deadline 15:40: at risk; ends between 15:39 and 15:42 on 6 threads in 8 of 10 cases; "
            "alone, the job needs 6 threads (6 to 8) until then");
  EXPECT_THAT(JudgeDeadline(At(4, 15, 35), now, kZone, row, 6),
              HasSubstr("missed unless workers come"));
  row.wall_seconds = {};
  EXPECT_EQ(JudgeDeadline(At(5, 15, 30), now, kZone, row, 0),
            "deadline 2026-05-05 15:30: no workers are connected; alone, the job needs 1 threads "
            "(1 to 1) until then");
}

TEST(DeadlineTest, FindsTheRowOfTheJob) {
  Quote quote;
  quote.rows.resize(2);
  quote.rows[0].target_error = 0.01;
  EXPECT_EQ(RowOfJob(quote, 0), nullptr);
  quote.rows[1].samples_given = 64;
  EXPECT_EQ(RowOfJob(quote, 0), &quote.rows[1]);
  EXPECT_EQ(RowOfJob(quote, 0.01), &quote.rows[0]);
  EXPECT_EQ(RowOfJob(quote, 0.02), nullptr);
}

}  // namespace
}  // namespace sheaf::cli
