// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/policy/retention.h"

#include <map>
#include <random>
#include <string>

#include "absl/strings/str_cat.h"
#include "coordinator/core/policy/aging_clock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

const absl::Time kNow = absl::FromUnixSeconds(1'800'000'000);
constexpr uint64_t kMebi = uint64_t{1} << 20;

KeptItem Item(KeptKind kind, uint64_t job_id, absl::Duration age, uint64_t mebi = 1) {
  KeptItem item{.kind = kind, .job_id = job_id};
  item.size_bytes = mebi * kMebi;
  item.unused_since = kNow - age;
  return item;
}

KeptItem Blob(char digit, absl::Duration age, bool is_named) {
  KeptItem item = Item(KeptKind::kBlob, 0, age);
  item.blob = {std::string(64, digit), kMebi};
  item.is_named = is_named;
  return item;
}

// "parts 7: it is older than the limit", one a line.
std::string Text(const std::vector<Removal>& removals) {
  std::string text;
  for (const Removal& removal : removals) {
    const KeptItem& item = removal.item;
    absl::StrAppend(&text, KeptKindName(item.kind), " ",
                    item.job_id > 0 ? absl::StrCat(item.job_id) : item.blob.sha256_hex.substr(0, 1),
                    ": ", RemovalReasonText(removal.reason), "\n");
  }
  return text;
}

RetentionLimits NoLimits() {
  RetentionLimits limits;
  limits.parts_age_max = limits.jobs_age_max = absl::InfiniteDuration();
  limits.unnamed_age_max = absl::InfiniteDuration();
  limits.free_bytes_min = 0;
  return limits;
}

TEST(AgingClockTest, AClockThatIsSetAheadAgesNothing) {
  const absl::Time start = absl::FromUnixSeconds(1'700'000'000);
  const absl::Duration boot = absl::Seconds(50);
  const AgingClock clock(start, boot);
  const auto at = [&](absl::Duration wall, absl::Duration passed) {
    return clock.At(start + wall, boot + passed) - start;
  };
  const absl::Duration month = absl::Hours(24 * 30), minute = absl::Minutes(1);
  EXPECT_EQ(at(minute, minute), minute);
  EXPECT_EQ(at(month, minute), minute) << "set ahead";
  EXPECT_EQ(at(month, month), month) << "a month has passed";
  EXPECT_EQ(at(-month, minute), -month) << "set back: what is there ages later";
  EXPECT_EQ(clock.Ahead(start + month, boot + minute), month - minute);

  // The parts of a job that ended before the jump.
  KeptItem parts;
  parts.job_id = 1;
  parts.size_bytes = 1;
  parts.unused_since = start;
  EXPECT_EQ(DecideRemovals({parts}, {}, {}, start + month).size(), 1u);
  EXPECT_EQ(DecideRemovals({parts}, {}, {}, clock.At(start + month, boot + minute)).size(), 0u);
}

TEST(RetentionTest, WithoutLimitsEverythingStays) {
  const std::vector<KeptItem> items = {Item(KeptKind::kParts, 1, absl::Hours(10'000)),
                                       Item(KeptKind::kJob, 1, absl::Hours(10'000)),
                                       Blob('a', absl::Hours(10'000), false)};
  EXPECT_TRUE(DecideRemovals(items, {kMebi * 1000, 0, 0}, NoLimits(), kNow).empty());
}

TEST(RetentionTest, UploadsGoFirstAndAtOnceWhereSpaceIsShort) {
  RetentionLimits limits = NoLimits();
  limits.free_bytes_min = 10 * kMebi;
  KeptItem upload = Item(KeptKind::kUpload, 0, absl::ZeroDuration());
  upload.blob = {std::string(64, 'u'), kMebi};
  KeptItem under_way = upload;
  under_way.in_use = true;
  const std::vector<KeptItem> items = {Item(KeptKind::kParts, 1, absl::Hours(10)), under_way,
                                       upload, Blob('a', absl::ZeroDuration(), false)};
  EXPECT_EQ(Text(DecideRemovals(items, {0, 9 * kMebi, 1000 * kMebi}, limits, kNow)),
            "upload u: the file system has too little free space\n");
  EXPECT_EQ(Text(DecideRemovals(items, {0, 8 * kMebi, 1000 * kMebi}, limits, kNow)),
            "upload u: the file system has too little free space\n"
            "parts 1: the file system has too little free space\n");
  // Pending writes count as written.
  EXPECT_EQ(Text(DecideRemovals(items, {0, 11 * kMebi, 1000 * kMebi, 2 * kMebi}, limits, kNow)),
            "upload u: the file system has too little free space\n");
}

TEST(RetentionTest, PartsGoByTheirAgeAndJobsByTheirs) {
  RetentionLimits limits = NoLimits();
  limits.parts_age_max = absl::Hours(7 * 24);
  limits.jobs_age_max = absl::Hours(90 * 24);
  std::vector<KeptItem> items;
  for (const auto& [job, days] : std::map<uint64_t, int>{{1, 100}, {2, 8}, {3, 6}}) {
    for (const KeptKind kind : {KeptKind::kJob, KeptKind::kPreviews, KeptKind::kParts}) {
      items.push_back(Item(kind, job, absl::Hours(24 * days)));
    }
  }
  EXPECT_EQ(Text(DecideRemovals(items, {}, limits, kNow)),
            "parts 1: it is older than the limit\n"
            "parts 2: it is older than the limit\n"
            "previews 1: it is older than the limit\n"
            "job 1: it is older than the limit\n");
}

TEST(RetentionTest, PartsAreKeptNoLongerThanTheirJob) {
  RetentionLimits limits = NoLimits();
  limits.jobs_age_max = absl::Hours(1);
  EXPECT_EQ(Text(DecideRemovals({Item(KeptKind::kJob, 1, absl::Hours(2)),
                                 Item(KeptKind::kParts, 1, absl::Hours(2))},
                                {}, limits, kNow)),
            "parts 1: it is older than the limit\njob 1: it is older than the limit\n");
}

TEST(RetentionTest, BlobsThatNoJobNamesGoAfterADay) {
  EXPECT_EQ(
      Text(DecideRemovals({Blob('a', absl::Hours(25), false), Blob('b', absl::Hours(23), false),
                           Blob('c', absl::Hours(25), true)},
                          {}, RetentionLimits(), kNow)),
      "blob a: no job names it\n");
}

TEST(RetentionTest, KindsGoInTheirOrderAndTheOldestFirst) {
  RetentionLimits limits = NoLimits();
  limits.bytes_max = 0;  // All that may go.
  const std::vector<KeptItem> items = {Item(KeptKind::kJob, 1, absl::Hours(9)),
                                       Item(KeptKind::kJob, 2, absl::Hours(8)),
                                       Item(KeptKind::kPreviews, 2, absl::Hours(8)),
                                       Item(KeptKind::kParts, 2, absl::Hours(8)),
                                       Item(KeptKind::kParts, 1, absl::Hours(9)),
                                       Blob('a', absl::Hours(9), true),
                                       Blob('b', absl::Hours(9), false)};
  EXPECT_EQ(Text(DecideRemovals(items, {kMebi * 7, UINT64_MAX, 0}, limits, kNow)),
            "parts 1: the state directory is above its limit\n"
            "parts 2: the state directory is above its limit\n"
            "blob a: the state directory is above its limit\n"
            "blob b: the state directory is above its limit\n"
            "previews 2: the state directory is above its limit\n"
            "job 1: the state directory is above its limit\n"
            "job 2: the state directory is above its limit\n");
}

TEST(RetentionTest, NoMoreGoesThanMakesRoom) {
  RetentionLimits limits = NoLimits();
  limits.bytes_max = 100 * kMebi;
  std::vector<KeptItem> items;
  for (uint64_t job = 1; job <= 10; ++job) {
    items.push_back(Item(KeptKind::kParts, job, absl::Hours(100) - absl::Hours(job), 3));
  }
  // 102 MiB: down to 95 MiB, which three of 3 MiB reach.
  EXPECT_EQ(DecideRemovals(items, {102 * kMebi, UINT64_MAX, 0}, limits, kNow).size(), 3);
  EXPECT_TRUE(DecideRemovals(items, {100 * kMebi, UINT64_MAX, 0}, limits, kNow).empty());
}

TEST(RetentionTest, WhatGoesByItsAgeCountsAsRoom) {
  RetentionLimits limits = NoLimits();
  limits.bytes_max = 100 * kMebi;
  limits.parts_age_max = absl::Hours(5);
  const std::vector<KeptItem> items = {Item(KeptKind::kParts, 1, absl::Hours(6), 50),
                                       Item(KeptKind::kParts, 2, absl::Hours(4), 50)};
  EXPECT_EQ(Text(DecideRemovals(items, {102 * kMebi, UINT64_MAX, 0}, limits, kNow)),
            "parts 1: it is older than the limit\n");
}

TEST(RetentionTest, FreshBlobsStayWhateverTheSpace) {
  RetentionLimits limits = NoLimits();
  limits.bytes_max = 0;
  EXPECT_TRUE(DecideRemovals({Blob('a', absl::Minutes(59), true)}, {kMebi, 0, kMebi}, limits, kNow)
                  .empty());
}

TEST(RetentionTest, JobsDoNotGoForTheFreeSpaceThatOthersMayTake) {
  RetentionLimits limits = NoLimits();
  limits.free_bytes_min = 10 * kMebi;
  const std::vector<KeptItem> items = {Item(KeptKind::kJob, 1, absl::Hours(9)),
                                       Item(KeptKind::kParts, 1, absl::Hours(9)),
                                       Item(KeptKind::kPreviews, 1, absl::Hours(9))};
  EXPECT_EQ(Text(DecideRemovals(items, {0, 1 * kMebi, 1000 * kMebi}, limits, kNow)),
            "parts 1: the file system has too little free space\n"
            "previews 1: the file system has too little free space\n");
  // A twentieth of a small file system is enough.
  EXPECT_TRUE(DecideRemovals(items, {0, 1 * kMebi, 20 * kMebi}, limits, kNow).empty());
}

// Random stores: nothing in use is removed, and removals for space follow the order of the kinds.
TEST(RetentionTest, NothingInUseEverGoes) {
  std::mt19937 random(68);
  for (int run = 0; run < 500; ++run) {
    std::vector<KeptItem> items;
    for (uint64_t i = 0; i < 20; ++i) {
      KeptItem item = Item(static_cast<KeptKind>(random() % kKeptKindCount), i + 1,
                           absl::Hours(random() % 400), random() % 4);
      item.in_use = random() % 3 == 0;
      item.is_named = random() % 2 == 0;
      items.push_back(item);
    }
    RetentionLimits limits;
    limits.bytes_max = (random() % 40) * kMebi;
    limits.jobs_age_max = absl::Hours(300);
    const std::vector<Removal> removals =
        DecideRemovals(items, {30 * kMebi, UINT64_MAX, 0}, limits, kNow);
    KeptKind last = KeptKind::kUpload;  // The first one.
    for (const Removal& removal : removals) {
      EXPECT_FALSE(removal.item.in_use);
      if (removal.reason != RemovalReason::kLimit) continue;
      EXPECT_LE(last, removal.item.kind);
      last = removal.item.kind;
    }
  }
}

}  // namespace
}  // namespace sheaf::coordinator
