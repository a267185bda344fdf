// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Quarantines, the results of those in quarantine, corrections, and failures of tasks, in the
// job store.
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/time/clock.h"
#include "common/base/digest.h"
#include "coordinator/store/tests/test_databases.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

class QuarantinesTest : public JobStoreFixture {
 protected:
  uint64_t CreateJob(const std::string& request_id) {
    JobSpec spec;
    spec.frames.resize(1);
    FrameSpec& frame = spec.frames[0];
    frame.frame_number = 7;
    frame.scene = {Sha256Hex("scene"), 1};
    frame.frame_digest = Sha256Hex("frame");
    frame.settings.width_px = frame.settings.height_px = 16;
    frame.settings.window = {0, 0, 16, 16};
    return store_->CreateJob(spec, request_id, absl::FromUnixSeconds(100))->job_id;
  }
  void WritePart(uint64_t job, uint64_t first, const std::string& identity) {
    PartRow row;
    row.key = {{job, 7}, {0, 0, 16, 16}, {first, 16}};
    row.digest = {Sha256Hex("bytes"), 5};
    row.worker_id = "w";
    row.identity = identity;
    ASSERT_TRUE(store_->WritePart(row, "bytes").ok());
  }
};

TEST_P(QuarantinesTest, QuarantinesSurviveAReopenUntilTheyAreRemoved) {
  const QuarantineRecord first{"a", "it failed", false, absl::FromUnixSeconds(2)};
  const QuarantineRecord second{"b", "it lied", true, absl::FromUnixSeconds(1)};
  ASSERT_TRUE(store_->WriteQuarantine(first).ok());
  ASSERT_TRUE(store_->WriteQuarantine({"b", "before", false, absl::FromUnixSeconds(5)}).ok());
  ASSERT_TRUE(store_->WriteQuarantine(second).ok());
  Reopen();
  EXPECT_EQ(*store_->LoadQuarantines(), (std::vector<QuarantineRecord>{second, first}));
  ASSERT_TRUE(store_->RemoveQuarantine("b").ok());
  ASSERT_TRUE(store_->RemoveQuarantine("unknown").ok());
  EXPECT_EQ(*store_->LoadQuarantines(), std::vector<QuarantineRecord>{first});
}

TEST_P(QuarantinesTest, PartsAreFoundByIdentityInAllJobs) {
  const uint64_t first = CreateJob("first"), second = CreateJob("second");
  WritePart(second, 0, "liar");
  WritePart(first, 0, "liar");
  WritePart(first, 16, "honest");
  Reopen();
  const absl::StatusOr<std::vector<PartRow>> parts = store_->FindPartsOf("liar");
  ASSERT_TRUE(parts.ok()) << parts.status();
  ASSERT_EQ(parts->size(), 2u);
  EXPECT_EQ((*parts)[0].key.frame, (FrameId{first, 7}));
  EXPECT_EQ((*parts)[1].key.frame, (FrameId{second, 7}));
  EXPECT_EQ((*parts)[1].identity, "liar");
}

TEST_P(QuarantinesTest, CorrectionsAndWarningsSurviveAReopen) {
  const uint64_t job = CreateJob("r");
  ASSERT_TRUE(store_->DeliverFrame({job, 7}, {}).ok());
  ASSERT_TRUE(store_->EndJob(job, JobPhase::kSucceeded, "", absl::Now(), {}).ok());
  const std::vector<StoredJob> before = *store_->LoadJobs();
  EXPECT_TRUE(before.at(0).corrections.empty());
  EXPECT_EQ(before.at(0).warning, "");
  for (int twice = 0; twice < 2; ++twice) {
    ASSERT_TRUE(store_->ReopenJob(job, {{before[0].spec.frames[0], {}, true}}).ok());
  }
  ASSERT_TRUE(store_->SetWarning(job, "corrected").ok());
  Reopen();
  const std::vector<StoredJob> after = *store_->LoadJobs();
  EXPECT_EQ(after.at(0).phase, JobPhase::kLive);
  EXPECT_TRUE(after.at(0).delivered.empty());
  EXPECT_EQ(after.at(0).corrections, (std::map<int32_t, int32_t>{{7, 1}}));
  EXPECT_EQ(after.at(0).warning, "corrected");
  ASSERT_TRUE(store_->DeliverFrame({job, 7}, {}).ok());
  EXPECT_EQ(store_->LoadJobs()->at(0).corrections.at(7), 1) << "delivery does not forget it";
}

TEST_P(QuarantinesTest, TroublesSurviveAReopen) {
  const uint64_t job = CreateJob("first"), other = CreateJob("other");
  TaskTrouble poison{{job, 7}, TaskKind::kCamera, {0, 16, 16, 32}, {16, 32}, {4, 0xf00f}, {}, ""};
  poison.failures = {{"a", "node a", FailureKind::kInternal, 1, "the 'crash'"},
                     {"", "", FailureKind::kLost, 12, "gone"},
                     {"b", "b", FailureKind::kMemory, 2, ""}};
  poison.set_aside = "failed on 2 workers";
  TaskTrouble killed{{job, 7}, TaskKind::kCamera, {}, {0, 0}, {}, {}, "killed by ann"};
  TaskTrouble passing = poison;
  passing.frame.job_id = other;
  passing.set_aside.clear();
  ASSERT_TRUE(store_->WriteTroubles({poison, killed, passing}).ok());
  poison.failures.pop_back();
  ASSERT_TRUE(store_->WriteTroubles({poison}).ok());
  Reopen();
  auto jobs = store_->LoadJobs();
  ASSERT_TRUE(jobs.ok()) << jobs.status();
  // Rows are ordered by worker.
  std::swap(poison.failures[0], poison.failures[1]);
  EXPECT_EQ(jobs->at(0).troubles, (std::vector<TaskTrouble>{killed, poison}));
  ASSERT_EQ(jobs->at(1).troubles.size(), 1u);
  EXPECT_EQ(jobs->at(1).troubles[0].failures.size(), 3u);
  poison.failures.clear();
  poison.set_aside.clear();
  ASSERT_TRUE(store_->WriteTroubles({poison}).ok());
  EXPECT_EQ(*store_->LoadTroubles(job), std::vector<TaskTrouble>{killed});
}

// A row that changed on disk says nothing: its task is rendered again.
TEST_P(QuarantinesTest, TroublesThatChangedOnDiskAreForgotten) {
  const uint64_t job = CreateJob("first");
  const TaskTrouble killed{{job, 7}, TaskKind::kCamera, {}, {0, 0}, {}, {}, "killed by ann"};
  ASSERT_TRUE(store_->WriteTroubles({killed}).ok());
  store_.reset();
  Execute("UPDATE task_failures SET frame_number = 8");
  Reopen();
  EXPECT_TRUE(store_->LoadTroubles(job)->empty());
}

SHEAF_ON_ALL_DATABASES(QuarantinesTest);

}  // namespace
}  // namespace sheaf::coordinator
