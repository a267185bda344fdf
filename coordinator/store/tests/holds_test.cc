// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Dependencies, approvals and drains in the job store.
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "common/base/digest.h"
#include "coordinator/store/tests/test_databases.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

class HoldsTest : public JobStoreFixture {
 protected:
  static JobSpec SpecOf(std::vector<JobDependency> dependencies) {
    JobSpec spec;
    spec.frames.resize(1);
    FrameSpec& frame = spec.frames[0];
    frame.frame_number = 7;
    frame.scene = {Sha256Hex("scene"), 1};
    frame.frame_digest = Sha256Hex("frame");
    frame.settings.samples = 16;
    spec.dependencies = std::move(dependencies);
    return spec;
  }
  uint64_t Create(const JobSpec& spec, const std::string& request_id) {
    return store_->CreateJob(spec, request_id, absl::FromUnixSeconds(100))->job_id;
  }
  StoredJob Job(uint64_t id) {
    const std::vector<StoredJob> jobs = *store_->LoadJobs();
    for (const StoredJob& job : jobs) {
      if (job.spec.job_id == id) return job;
    }
    return {};
  }
};

TEST_P(HoldsTest, DependenciesStayUntilTheyAreReleased) {
  const uint64_t first = Create(SpecOf({}), "a"), second = Create(SpecOf({}), "b");
  const std::vector<JobDependency> on_both{{first, true}, {second, false}};
  const uint64_t third = Create(SpecOf(on_both), "c"), fourth = Create(SpecOf({{second}}), "d");
  Reopen();
  EXPECT_EQ(Job(third).spec.dependencies, on_both);
  EXPECT_THAT(Job(first).spec.dependencies, IsEmpty());
  ASSERT_TRUE(store_->ReleaseJob(third).ok());
  EXPECT_TRUE(Job(third).spec.dependencies[0].released);
  EXPECT_TRUE(Job(third).spec.dependencies[1].released);
  EXPECT_FALSE(Job(fourth).spec.dependencies[0].released);
}

TEST_P(HoldsTest, EventsStayInOrderAndTheOldestGo) {
  JobSpec spec = SpecOf({});
  spec.command = "sheaf submit a.pbrt";
  const uint64_t first = Create(spec, "a"), second = Create(SpecOf({}), "b");
  std::vector<JobEvent> events;
  for (int64_t i = 0; i < kJobEventsMax + 2; ++i) {
    events.push_back({first, absl::FromUnixSeconds(200 + i), "started", "workers/w", 7, "x"});
  }
  events.push_back({second, absl::FromUnixSeconds(5), "pause", "anna"});
  events.push_back({99, absl::FromUnixSeconds(6), "pause", "anna"});  // No such job.
  ASSERT_TRUE(store_->AppendEvents(events).ok());
  Reopen();
  EXPECT_EQ(Job(first).spec.command, "sheaf submit a.pbrt");
  const std::vector<JobEvent> kept = *store_->LoadEvents(first);
  ASSERT_EQ(kept.size(), static_cast<size_t>(kJobEventsMax));
  EXPECT_EQ(kept.front(), events[2]);
  EXPECT_EQ(kept.back(), events[kJobEventsMax + 1]);
  EXPECT_EQ(*store_->LoadEvents(second), std::vector<JobEvent>{events[kJobEventsMax + 2]});
  EXPECT_THAT(*store_->LoadEvents(99), IsEmpty());
  ASSERT_TRUE(store_
                  ->EndJob(second, JobPhase::kCancelled, "", absl::FromUnixSeconds(300),
                           absl::ZeroDuration())
                  .ok());
  ASSERT_TRUE(store_->RemoveJob(second).ok());
  EXPECT_THAT(*store_->LoadEvents(second), IsEmpty());
}

TEST_P(HoldsTest, RemovedJobsAreRemembered) {
  const uint64_t first = Create(SpecOf({}), "a"), second = Create(SpecOf({{first}}), "b");
  ASSERT_TRUE(store_->EndJob(first, JobPhase::kSucceeded, "", absl::FromUnixSeconds(200), {}).ok());
  ASSERT_TRUE(store_->RemoveJob(first).ok());
  Reopen();
  EXPECT_TRUE(Job(second).spec.dependencies.at(0).removed);
  ASSERT_TRUE(
      store_->EndJob(second, JobPhase::kSucceeded, "", absl::FromUnixSeconds(200), {}).ok());
  ASSERT_TRUE(store_->RemoveJob(second).ok());
  EXPECT_THAT(*store_->LoadJobs(), IsEmpty());
}

TEST_P(HoldsTest, AFrameThatGetsTheSamplesIsApproved) {
  JobSpec spec = SpecOf({});
  spec.approvals[7] = {64, false};
  const uint64_t id = Create(spec, "a");
  JobStore::ReopenedFrame frame{Job(id).spec.frames[0], {}};
  ASSERT_TRUE(store_->ReopenJob(id, {frame}).ok());
  Reopen();
  EXPECT_EQ(Job(id).spec.approvals.at(7), (FrameApproval{64, false})) << "it was only corrected";
  frame.spec.settings.samples = 64;
  ASSERT_TRUE(store_->ReopenJob(id, {frame}).ok());
  Reopen();
  EXPECT_EQ(Job(id).spec.approvals.at(7), (FrameApproval{64, true}));
  EXPECT_EQ(Job(id).spec.frames[0].settings.samples, 64u);
  EXPECT_EQ(Job(id).damage, "");
}

TEST_P(HoldsTest, AChangedApprovalIsNoticed) {
  JobSpec spec = SpecOf({});
  spec.approvals[7] = {64, false};
  const uint64_t id = Create(spec, "a");
  store_.reset();
  Execute("UPDATE approvals SET samples = 65");
  Reopen();
  EXPECT_THAT(Job(id).damage, HasSubstr("approval of frame 7"));
}

TEST_P(HoldsTest, DrainsStayUntilTheyAreRemoved) {
  const DrainRecord first{"a", true, absl::FromUnixSeconds(5)},
      second{"b", false, absl::FromUnixSeconds(3)};
  ASSERT_TRUE(store_->WriteDrains({second, {"a", false, absl::FromUnixSeconds(4)}}).ok());
  ASSERT_TRUE(store_->WriteDrains({first}).ok());
  Reopen();
  EXPECT_EQ(*store_->LoadDrains(), (std::vector<DrainRecord>{first, second}));
  ASSERT_TRUE(store_->RemoveDrains({"a", "c"}).ok());
  EXPECT_EQ(*store_->LoadDrains(), std::vector<DrainRecord>{second});
}

SHEAF_ON_ALL_DATABASES(HoldsTest);

}  // namespace
}  // namespace sheaf::coordinator
