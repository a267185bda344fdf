// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/policy/usage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "coordinator/core/job/job.h"
#include "coordinator/core/policy/owner_bytes.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

Usage UsageOf(int64_t cpu_seconds) {
  return {.result_count = 1, .sample_count = 10, .cpu_duration = absl::Seconds(cpu_seconds)};
}

std::vector<UsageRow> Rows() {
  return {{100, "anna", "film", 7, UsageOf(1)},        {101, "anna", "film", 7, UsageOf(2)},
          {101, "anna", "short", 8, UsageOf(4)},       {101, "ben", "film", 9, UsageOf(16)},
          {102, "ben", "", kFirstPilotId, UsageOf(8)}, {102, "ben", "", 0, {.upload_bytes = 5}}};
}

TEST(UsageTest, SumsByUser) {
  const auto sums = SumUsage(Rows(), {});
  ASSERT_TRUE(sums.ok());
  ASSERT_EQ(sums->size(), 2u);
  EXPECT_EQ((*sums)[0].user, "ben") << "most CPU time first";
  EXPECT_EQ((*sums)[0].usage.cpu_duration, absl::Seconds(24));
  EXPECT_EQ((*sums)[0].usage.upload_bytes, 5u);
  EXPECT_EQ((*sums)[1].usage.cpu_duration, absl::Seconds(7));
  EXPECT_EQ((*sums)[1].usage.sample_count, 30u);
  EXPECT_FALSE((*sums)[1].day.has_value());
  EXPECT_EQ((*sums)[1].show, "") << "the rows differ in it";
}

TEST(UsageTest, SumsByShowOfOneUserWithinDays) {
  UsageQuery query{.by = UsageBy::kShow, .since_day = 101, .until_day = 101};
  query.owner = "anna";
  const auto sums = SumUsage(Rows(), query);
  ASSERT_TRUE(sums.ok());
  ASSERT_EQ(sums->size(), 2u);
  EXPECT_EQ((*sums)[0].show, "short");
  EXPECT_EQ((*sums)[1].show, "film");
  EXPECT_EQ((*sums)[1].usage.cpu_duration, absl::Seconds(2)) << "neither day 100 nor ben's";
}

TEST(UsageTest, SumsByJobAndDay) {
  const auto sums = SumUsage(Rows(), {.by = UsageBy::kJob, .daily = true});
  ASSERT_TRUE(sums.ok());
  std::vector<std::string> names;
  for (const UsageSum& sum : *sums) names.push_back(absl::StrCat(*sum.day, " ", sum.job));
  EXPECT_THAT(names, ::testing::ElementsAre("100 jobs/7", "101 jobs/9", "101 jobs/8", "101 jobs/7",
                                            "102 pilots", "102 uploads"));
}

TEST(UsageTest, RefusesAnswersThatAreTooLong) {
  std::vector<UsageRow> rows(kUsageRowsMax + 1);
  for (size_t i = 0; i < rows.size(); ++i) rows[i].job_id = i + 1;
  EXPECT_TRUE(absl::IsInvalidArgument(SumUsage(rows, {.by = UsageBy::kJob}).status()));
  EXPECT_TRUE(SumUsage(rows, {.by = UsageBy::kUser}).ok());
}

TEST(UsageTest, DaysAreThoseOfUtc) {
  const absl::Time midnight = absl::FromCivil(absl::CivilDay(2026, 5, 4), absl::UTCTimeZone());
  EXPECT_EQ(FormatUsageDay(UsageDayOf(midnight)), "2026-05-04");
  EXPECT_EQ(FormatUsageDay(UsageDayOf(midnight - absl::Nanoseconds(1))), "2026-05-03");
  EXPECT_EQ(ParseUsageDay("2026-05-04").value_or(-1), UsageDayOf(midnight));
  EXPECT_FALSE(ParseUsageDay("2026-13-01").ok());
  EXPECT_FALSE(ParseUsageDay("today").ok());
}

TEST(UsageTest, QueriesAreReadFromTexts) {
  const auto query = ParseUsageQuery("job", "1970-01-02", "1970-01-05", true);
  ASSERT_TRUE(query.ok());
  EXPECT_EQ(query->by, UsageBy::kJob);
  EXPECT_EQ(query->since_day, 1);
  EXPECT_EQ(query->until_day, 4);
  EXPECT_TRUE(query->daily);
  EXPECT_TRUE(ParseUsageQuery("", "", "", false).ok());
  EXPECT_FALSE(ParseUsageQuery("scene", "", "", false).ok());
  EXPECT_FALSE(ParseUsageQuery("", "1970-01-05", "1970-01-02", false).ok());
}

TEST(UsageTest, CsvQuotesWhatNeedsIt) {
  const std::vector<UsageSum> sums = {
      {.day = 0, .user = "anna", .show = "a \"b\", c", .job = "jobs/7", .usage = UsageOf(2)}};
  EXPECT_THAT(UsageCsv(sums),
              HasSubstr("\n1970-01-01,anna,\"a \"\"b\"\", c\",jobs/7,1,10,0,2.000,0,"
                        "0.000,0,0.000,0,0,0\n"));
}

TEST(OwnerBytesTest, RefusesBeyondTheLimitAndSaysWhatTakesIt) {
  const OwnerBytes kept{.content_bytes = 1024, .part_bytes = 3 << 20, .image_bytes = 10};
  EXPECT_TRUE(CheckOwnerBytes("anna", kept, 100, kept.Total() + 100).ok());
  EXPECT_TRUE(CheckOwnerBytes("anna", kept, UINT64_MAX, UINT64_MAX).code() ==
              absl::StatusCode::kResourceExhausted);
  EXPECT_TRUE(CheckOwnerBytes("anna", kept, 0, kept.Total() + 1).ok());
  const absl::Status refused = CheckOwnerBytes("anna", kept, 101, kept.Total() + 100);
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  for (const char* words : {"anna", "3.0 MiB of parts", "10 bytes of images", "1.0 KiB of files",
                            "101 bytes more", "sheaf unpin", "sheaf gc", "--user-bytes-max"}) {
    EXPECT_THAT(std::string(refused.message()), HasSubstr(words));
  }
  EXPECT_FALSE(CheckOwnerBytes("anna", kept, 0, kept.Total()).ok()) << "nothing more fits";
}

}  // namespace
}  // namespace sheaf::coordinator
