// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the farm with a disk that refuses to remove parts.
#include "coordinator/service/farm/state/part_removals.h"

#include <future>
#include <string>
#include <vector>

#include "absl/cleanup/cleanup.h"
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/digest.h"
#include "common/base/mutex.h"
#include "coordinator/service/farm/tests/farm_fixture.h"
#include "coordinator/store/database/sqlite_database.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

// A part is found damaged while the disk refuses to remove it: the one that is rendered again takes
// its place.
TEST_F(FarmTest, ADamagedPartThatCannotBeRemovedIsReplaced) {
  store_->Open();
  const std::string job = absl::StrCat(MakeJob({}));
  Work();
  DamageParts();
  Start();
  store_->Open();
  store_->keeps_parts_ = true;
  const SteadyTime deadline = SteadyTime::Now() + absl::Seconds(600);
  while (store_->removals_refused_ == 0 && SteadyTime::Now() < deadline) {
    Work(absl::Milliseconds(2));
  }
  EXPECT_GT(store_->removals_refused_, 0);
  store_->keeps_parts_ = false;
  while (!farm_->view().FindJob(job)->frames[0].complete && SteadyTime::Now() < deadline) {
    Work(absl::Milliseconds(2));
  }
  EXPECT_TRUE(farm_->view().FindJob(job)->frames[0].complete);
}

// Parts are gone when the farm starts, and the disk refuses to remove their rows: their work is
// done again, and each counts once.
TEST_F(FarmTest, LostPartsWhoseRowsCannotBeRemovedAreRenderedAgain) {
  StartWithoutThread();
  store_->Open();
  const uint64_t id = MakeJob({});
  Work();
  Work();
  RemovePartFiles();
  auto database = SqliteDatabase::Open(directory_ + "/farm.db");
  ASSERT_TRUE(database.ok());
  ASSERT_TRUE((*database)
                  ->Execute("CREATE TRIGGER full BEFORE DELETE ON parts "
                            "BEGIN SELECT RAISE(ABORT, 'the disk is full'); END")
                  .ok());
  StartWithoutThread();
  store_->Open();
  EXPECT_EQ(PartsRevoked(), 2u);
  farm_->RunOnce();
  Work(absl::ZeroDuration(), absl::StatusCode::kUnavailable);  // The old row is in the way.
  ASSERT_TRUE((*database)->Execute("DROP TRIGGER full").ok());
  farm_->RunOnce();
  Finish(id);
  EXPECT_EQ(PartsRevoked(), 2u);
}

// The disk may refuse to remove a part that was superseded while it was written. The next start
// finds it beside those that cover its samples.
TEST_F(FarmTest, StartsWithPartsThatOverlap) {
  store_->Open();
  const std::string job = absl::StrCat(MakeJob({}));
  const std::vector<LeaseGrant> grants = Lease("w");
  ASSERT_EQ(grants.size(), 1u);
  const auto& lease = grants[0].lease;
  ASSERT_TRUE(Deliver(grants[0]).ok());
  const SampleBlock half{lease.task.block.first, lease.task.block.count / 2};
  const std::string bytes = Render(grants[0], half);
  const PartRow row{.key = {lease.frame, lease.tile_rect, half, lease.cells},
                    .digest = {Sha256Hex(bytes), bytes.size()},
                    .worker_id = "w",
                    .cost = {}};
  ASSERT_TRUE(store_->WritePart(row, bytes).ok());
  Start(/*keeps_parts=*/true);
  store_->Open();
  EXPECT_GE(store_->removals_refused_, 1);
  const SteadyTime deadline = SteadyTime::Now() + absl::Seconds(600);
  while (!farm_->view().FindJob(job)->frames[0].complete && SteadyTime::Now() < deadline) {
    Work(absl::Milliseconds(2));
  }
  EXPECT_TRUE(farm_->view().FindJob(job)->frames[0].complete);
}

// A late result from before a restart is superseded while it is written, and the disk refuses to
// remove it: it does not belong to its frame, neither when a tile is built from disk nor in a
// refined job.
TEST_F(FarmTest, ASupersededPartThatCannotBeRemovedIsNotMerged) {
  options_.merge_bytes_max = 0;     // Each tile is built from disk.
  partition_.lease_pass_count = 0;  // Fast workers get large blocks.
  StartWithoutThread();
  const uint64_t id = MakeJob({});
  const std::vector<LeaseGrant> late = Lease("late");
  ASSERT_EQ(late.size(), 1u);
  StartWithoutThread();
  LearnSpeed();
  store_->holds_parts_ = true;
  std::future<absl::Status> superseded =
      std::async(std::launch::async, [&] { return Deliver(late[0]); });
  const absl::Cleanup open_gate = [this] { store_->Open(); };
  store_->WaitUntilSomeoneIsThere();
  const std::vector<LeaseGrant> larger = Lease("w");
  ASSERT_EQ(larger.size(), 1u);
  ASSERT_EQ(larger[0].lease.frame.job_id, id);
  ASSERT_GT(larger[0].lease.task.block.count, late[0].lease.task.block.count);
  store_->keeps_parts_ = true;
  store_->Open();
  ASSERT_TRUE(superseded.get().ok());
  ASSERT_EQ(store_->removals_refused_, 1);
  ASSERT_TRUE(Deliver(larger[0]).ok());
  Finish(id);
  EXPECT_TRUE(farm_->RefineJob(id, {.refinement = {{}, 512}}).ok());
  Finish(id);
  EXPECT_EQ(farm_->view().FindJob(absl::StrCat(id))->progress.sample_count_done, 16u * 16u * 512u);
  const PartKey key{late[0].lease.frame, late[0].lease.tile_rect, late[0].lease.task.block,
                    late[0].lease.cells};
  EXPECT_TRUE(store_->FindPart(key)->has_value());
  store_->keeps_parts_ = false;
  farm_->RunOnce();
  EXPECT_FALSE(store_->FindPart(key)->has_value());
}

// While false results are still to be removed, their maker's row says so to the next start.
TEST_F(FarmTest, AQuarantineIsLiftedAfterFalseResultsAreRemoved) {
  StartWithoutThread();
  store_->Open();
  const uint64_t id = MakeJob({});
  Work();
  Distrust("w");
  store_->keeps_parts_ = true;
  farm_->RunOnce();
  EXPECT_EQ(farm_->LiftQuarantine("w").code(), absl::StatusCode::kFailedPrecondition);
  StartWithoutThread();
  store_->Open();
  farm_->RunOnce();
  EXPECT_EQ(farm_->view().FindJob(absl::StrCat(id))->progress.sample_count_done, 0u);
  EXPECT_TRUE(farm_->LiftQuarantine("w").ok());
  EXPECT_EQ(Lease("w").size(), 1u);
}

// The disk takes no quarantine: nothing of its maker is removed before it does. A stop in between
// would leave false results and nothing that says so.
TEST_F(FarmTest, FalseResultsStayUntilTheQuarantineIsDurable) {
  StartWithoutThread();
  store_->Open();
  const uint64_t id = MakeJob({});
  Finish(id);
  const size_t count = store_->FindPartsOf("w")->size();
  store_->refuses_quarantines_ = true;
  Distrust("w");
  farm_->RunOnce();
  EXPECT_EQ(store_->FindPartsOf("w")->size(), count);
  EXPECT_EQ(PartsRevoked(), 0u);
  store_->refuses_quarantines_ = false;
  EXPECT_TRUE(farm_->CancelJob(MakeJob({}, 64)).ok());  // The disk takes that.
  farm_->RunOnce();
  EXPECT_EQ(store_->FindPartsOf("w")->size(), 0u);
  EXPECT_EQ(PartsRevoked(), count);
}

// A quarantine that is not stored yet is not lifted: stored later, it would return at the next
// start.
TEST_F(FarmTest, AQuarantineIsStoredBeforeItIsLifted) {
  StartWithoutThread();
  store_->Open();
  MakeJob({});
  store_->refuses_quarantines_ = true;
  {
    const MutexLock lock(&farm_->tables().mutex);
    farm_->tables().scheduler.Quarantine("w", "it failed often", /*made_false_results=*/false);
    farm_->tables().NoteEndedJobs();
  }
  EXPECT_EQ(farm_->LiftQuarantine("w").code(), absl::StatusCode::kResourceExhausted);
  store_->refuses_quarantines_ = false;
  EXPECT_TRUE(farm_->LiftQuarantine("w").ok());
  StartWithoutThread();
  store_->Open();
  EXPECT_EQ(Lease("w").size(), 1u);
}

// The disk removes one of the false results and refuses the others: their frame is corrected at
// once, and each result and the correction count once, however often the disk is asked again.
TEST_F(FarmTest, ACorrectionThatTheDiskDelaysCountsOnce) {
  StartWithoutThread();
  store_->Open();
  const uint64_t id = MakeJob({});
  Finish(id);
  const size_t count = store_->FindPartsOf("w")->size();
  ASSERT_GT(count, 2u);
  store_->removals_allowed_ = 1;
  Distrust("w");
  for (int32_t priority = 1; priority <= 3; ++priority) {
    farm_->RunOnce();
    EXPECT_TRUE(farm_->SetJobPriority(id, {.priority = priority}).ok());  // The disk takes that.
  }
  EXPECT_EQ(store_->FindPartsOf("w")->size(), count - 1);
  EXPECT_EQ(PartsRevoked(), count);
  EXPECT_EQ(farm_->view().FindJob(absl::StrCat(id))->progress.sample_count_done, 0u);
  store_->removals_allowed_ = INT64_MAX;
  farm_->RunOnce();
  EXPECT_TRUE(farm_->LiftQuarantine("w").ok());
  Finish(id);
  EXPECT_EQ(PartsRevoked(), count);
  EXPECT_EQ(farm_->view().FindJob(absl::StrCat(id))->frames[0].correction_count, 1);
}

// A correction fails when its frame is marked already: the next try makes all of it, and counts
// once.
TEST_F(FarmTest, ACorrectionThatFailsIsMadeAsAWhole) {
  StartWithoutThread();
  store_->Open();
  const uint64_t id = MakeJob({});
  Finish(id);
  const size_t count = store_->FindPartsOf("w")->size();
  store_->refuses_rounds_ = true;
  Distrust("w");
  farm_->RunOnce();
  EXPECT_EQ(PartsRevoked(), 0u);
  store_->refuses_rounds_ = false;
  farm_->RunOnce();
  EXPECT_EQ(PartsRevoked(), count);
  EXPECT_EQ(farm_->view().FindJob(absl::StrCat(id))->progress.sample_count_done, 0u);
  EXPECT_TRUE(farm_->LiftQuarantine("w").ok());
  Finish(id);
  StartWithoutThread();
  store_->Open();
  EXPECT_EQ(farm_->view().FindJob(absl::StrCat(id))->frames[0].correction_count, 1);
}

}  // namespace
}  // namespace sheaf::coordinator
