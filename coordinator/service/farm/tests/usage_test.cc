// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The farm's accounts, and the limit of a user's stored bytes.
#include <gmock/gmock.h>

#include <map>
#include <string>

#include "coordinator/service/farm/queries/user_metrics.h"
#include "coordinator/service/farm/tests/farm_fixture.h"
#include "coordinator/store/database/sqlite_database.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

class FarmUsageTest : public FarmTest {
 protected:
  // The sum over all that the farm has done.
  Usage Total() {
    const auto report = farm_->ListUsage({});
    SHEAF_CHECK(report.ok());
    Usage total;
    for (const UsageSum& sum : report->sums) total += sum.usage;
    return total;
  }
  std::map<std::string, OwnerBytes> Kept() {
    const auto report = farm_->ListUsage({});
    SHEAF_CHECK(report.ok());
    std::map<std::string, OwnerBytes> kept;
    for (const StoredView& stored : report->stored) kept[stored.user] = stored.bytes;
    return kept;
  }
};

TEST_F(FarmUsageTest, AJobsWorkIsAccountedFor) {
  StartWithoutThread();
  store_->Open();
  const uint64_t job = MakeJob({});
  Finish(job);
  const auto report = farm_->ListUsage({.by = UsageBy::kJob});
  ASSERT_TRUE(report.ok());
  ASSERT_EQ(report->sums.size(), 1u);
  EXPECT_EQ(report->sums[0].job, absl::StrCat("jobs/", job));
  const Usage& usage = report->sums[0].usage;
  EXPECT_EQ(usage.sample_count, 256u * 256u);
  EXPECT_EQ(usage.cpu_duration, 256 * 256 * kSampleCpu);
  EXPECT_EQ(usage.repeated_count + usage.lost_count, 0u);
  EXPECT_GT(usage.image_bytes, 0u);
  const OwnerBytes kept = Kept()[kLocalOwner];
  EXPECT_EQ(kept.part_bytes, usage.part_bytes);
  EXPECT_GE(kept.image_bytes, usage.image_bytes) << "with the thumbnail";
  EXPECT_EQ(kept.content_bytes, 7u) << "the scene";
}

TEST_F(FarmUsageTest, LostWorkStaysInTheAccount) {
  StartWithoutThread();
  MakeJob({});
  const std::vector<LeaseGrant> grants = Lease("w");
  ASSERT_EQ(grants.size(), 1u);
  ASSERT_TRUE(Deliver(grants[0]).ok());
  const absl::Duration cpu = Total().cpu_duration;
  EXPECT_GT(cpu, absl::ZeroDuration());
  ASSERT_TRUE(Deliver(grants[0]).ok());
  EXPECT_EQ(Total().result_count, 1u) << "sent again, and rendered once";
  Distrust("w");
  farm_->RunOnce();
  const Usage total = Total();
  EXPECT_EQ(total.lost_count, 1u) << "the part is removed";
  EXPECT_EQ(total.lost_cpu_duration, cpu);
  EXPECT_EQ(total.cpu_duration, cpu);
}

TEST_F(FarmUsageTest, WorkThatIsDoneTwiceIsRepeated) {
  options_.limits.check_fraction = 1;
  StartWithoutThread();
  MakeJob({});
  // Two workers share the tasks, and each checks those of the other.
  for (int i = 0; i < 300; ++i) {
    for (const char* worker : {"v", "w"}) {
      for (const LeaseGrant& grant : Lease(worker)) ASSERT_TRUE(Deliver(grant).ok());
    }
  }
  const Usage total = Total();
  EXPECT_GT(total.repeated_count, 0u);
  EXPECT_EQ(total.cpu_duration - total.repeated_cpu_duration, 256 * 256 * kSampleCpu);
  EXPECT_GT(total.sample_count, 256u * 256u) << "repeated ones are among them";
  EXPECT_EQ(total.lost_count, 0u);
}

TEST_F(FarmUsageTest, NotesReachTheDiskByThemselves) {
  StartWithoutThread();
  farm_->NoteUpload("ben", {Sha256Hex("x"), 1}, 1);
  farm_->RunOnce();
  const auto rows = SqliteDatabase::Open(directory_ + "/farm.db");
  ASSERT_TRUE(rows.ok());
  Statement query = (*rows)->Prepare("SELECT upload_bytes FROM usage WHERE owner = 'ben'");
  const absl::StatusOr<bool> found = query.Step();
  ASSERT_TRUE(found.ok() && *found);
  EXPECT_EQ(query.Int64(0), 1);
}

TEST_F(FarmUsageTest, UploadsCountForTheirUserUntilOthersShareThem) {
  StartWithoutThread();
  const auto orphan = farm_->blobs().Put("an orphan");
  ASSERT_TRUE(orphan.ok());
  farm_->NoteUpload("ben", *orphan, 9);
  EXPECT_EQ(Kept()["ben"].content_bytes, 9u);
  farm_->NoteUpload("ben", {Sha256Hex("more"), 4}, 4);
  EXPECT_EQ(Kept()["ben"].content_bytes, 13u) << "at once, whatever the age of the list";
  EXPECT_EQ(Total().upload_bytes, 13u);
}

TEST_F(FarmUsageTest, AUserMayKeepSoMuch) {
  options_.limits.owner_bytes_max = 10;
  StartWithoutThread();
  EXPECT_TRUE(farm_->keeper().CheckOwner(kLocalOwner, 10).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(farm_->keeper().CheckOwner(kLocalOwner, 11)));
  StartWithoutThread();
  MakeJob({});  // Its scene has 7 bytes.
  EXPECT_TRUE(farm_->keeper().CheckOwner(kLocalOwner, 3).ok());
  const absl::Status refused = farm_->keeper().CheckOwner(kLocalOwner, 4);
  EXPECT_TRUE(absl::IsResourceExhausted(refused));
  EXPECT_THAT(std::string(refused.message()), HasSubstr("7 bytes of files"));
  EXPECT_TRUE(farm_->keeper().CheckOwner("ben", 10).ok()) << "others are not held up";
  const auto report = farm_->ListUsage({});
  ASSERT_TRUE(report.ok());
  ASSERT_EQ(report->stored.size(), 1u);
  EXPECT_EQ(report->stored[0].bytes_max, 10u);
}

TEST_F(FarmUsageTest, AFarmOnAHealthyDiskIsReady) {
  const std::vector<ReadyCondition> conditions = farm_->view().Conditions();
  ASSERT_EQ(conditions.size(), 2u);
  for (const ReadyCondition& condition : conditions) {
    EXPECT_TRUE(condition.status.ok()) << condition.name << ": " << condition.status;
  }
}

TEST_F(FarmUsageTest, AFileSystemBelowItsMinimumIsNotReady) {
  options_.retention.free_bytes_min = UINT64_MAX;  // A twentieth of it, then.
  const auto space = std::filesystem::space(directory_);
  StartWithoutThread();
  const bool is_short = space.available < space.capacity / kFreeFractionMax;
  EXPECT_EQ(farm_->view().Conditions()[1].status.ok(), !is_short);
}

TEST(UserMetricsTest, UsersBeyondTheLimitAreOne) {
  std::map<std::string, UserFigures> users;
  for (int i = 0; i < 60; ++i) {
    users[absl::StrCat("user", i)] = {.jobs = 1, .samples = 2, .cpu_seconds = 1.0 + i};
  }
  std::vector<MetricView> metrics;
  AddUserMetrics(users, &metrics);
  ASSERT_EQ(metrics.size(), 3 * (kUserMetricsMax + 1));
  EXPECT_EQ(metrics[0].label_value, "user59") << "most CPU time first";
  const MetricView& rest = metrics[kUserMetricsMax];
  EXPECT_EQ(rest.name, "sheaf_user_jobs");
  EXPECT_EQ(rest.label_value, kOther);
  EXPECT_EQ(rest.value, 10);
  users["other"] = {.jobs = 5, .samples = 0, .cpu_seconds = 1000};
  metrics.clear();
  AddUserMetrics(users, &metrics);
  ASSERT_EQ(metrics.size(), 3 * kUserMetricsMax);
  EXPECT_EQ(metrics[0].label_value, kOther);
  EXPECT_EQ(metrics[0].value, 5 + 11);
}

}  // namespace
}  // namespace sheaf::coordinator
