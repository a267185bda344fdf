// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/share_setting.h"

#include <gtest/gtest.h>

#include <limits>

#include "coordinator/core/job/requirements.h"

namespace sheaf::coordinator {
namespace {

TEST(ShareSettingTest, NamesUsersShowsAndPools) {
  for (const char* text : {"user:anna@example.org", "show:comet_2", "pool:gpu-free"}) {
    const absl::StatusOr<ShareSubject> subject = ParseShareSubject(text);
    ASSERT_TRUE(subject.ok()) << subject.status();
    EXPECT_EQ(FormatShareSubject(*subject), text);
  }
  EXPECT_EQ(ParseShareSubject("show:comet")->kind, ShareKind::kShow);
  for (const char* text : {"anna", "job:7", "user:", "user:a b", "show:\n", "User:anna"}) {
    EXPECT_TRUE(absl::IsInvalidArgument(ParseShareSubject(text).status())) << text;
  }
}

TEST(ShareSettingTest, RefusesSettingsThatMakeNoSense) {
  const ShareSubject user{ShareKind::kUser, "anna"}, pool{ShareKind::kPool, "gpu"};
  EXPECT_TRUE(CheckShareSetting(user, {2, 64}).ok());
  EXPECT_TRUE(CheckShareSetting(pool, {1, 64}).ok());
  EXPECT_FALSE(CheckShareSetting(pool, {2, 64}).ok());
  for (const double weight : {0.0, -1.0, 1e4, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_FALSE(CheckShareSetting(user, {weight, 0}).ok()) << weight;
  }
  EXPECT_FALSE(CheckShareSetting(user, {1, -1}).ok());
}

TEST(RequirementsTest, TagsKeepTheirOrderAndMemoryIsRoundedUp) {
  EXPECT_EQ(ParseTags(FormatTags(SortedTags({"ssd", "avx", "ssd"}))),
            (std::vector<std::string>{"avx", "ssd"}));
  EXPECT_TRUE(ParseTags("").empty());
  const uint64_t gib = uint64_t{1} << 30;
  EXPECT_EQ(RoundMemoryUp(0), 0u);
  EXPECT_EQ(RoundMemoryUp(5 * gib), 5 * gib);
  EXPECT_EQ(RoundMemoryUp(5 * gib + 1), 6 * gib);
  EXPECT_EQ(RoundMemoryUp(3), 3u);
  EXPECT_EQ(RoundMemoryUp(UINT64_MAX), UINT64_MAX);
  Requirements requirements;
  EXPECT_TRUE(CheckRequirements(requirements).ok());
  requirements.tags.assign(kJobTagsMax + 1, "x");
  EXPECT_FALSE(CheckRequirements(requirements).ok());
  EXPECT_FALSE(CheckWorkerTraits({"", {}, 0}).ok());
}

}  // namespace
}  // namespace sheaf::coordinator
