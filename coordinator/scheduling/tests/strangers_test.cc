// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The limits of strangers, which are workers that have delivered nothing; and quarantine.
#include <string>
#include <vector>

#include "absl/time/clock.h"
#include "coordinator/scheduling/tests/scheduler_fixture.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;

// Workers never seen before, on a farm with one that has delivered results.
class StrangersTest : public SchedulerTest {
 protected:
  StrangersTest() : SchedulerTest(Limits()) {
    AddJob();
    Accept(Sync("old", 1).at(0));
    scheduler_.EndJob(last_job_id_, JobPhase::kCancelled, "");
    Sync("old", 0);
  }
  // Has the worker fail one lease.
  void FailOne(const std::string& id, FailureKind kind) {
    const std::vector<Lease>& leases = Sync(id, 1);
    ASSERT_FALSE(leases.empty());
    Fail(leases[0], kind, "x.pbrt:1:1: \x1b[2J is bad");
    Sync(id, 0);
  }
};

TEST_F(StrangersTest, LeasesGrowWithResults) {
  AddJob(20);
  EXPECT_EQ(Sync("new", 256).size(), static_cast<size_t>(limits_.unproven_leases_min));
  EXPECT_EQ(Sync("new", 256).size(), static_cast<size_t>(limits_.unproven_leases_min));
  Accept(held_["new"][0]);
  EXPECT_EQ(Sync("new", 256).size(),
            static_cast<size_t>(limits_.unproven_leases_min + limits_.leases_per_result));
  while (Sync("new", 256).size() < 256 && !held_["new"].empty()) Accept(held_["new"][0]);
  EXPECT_EQ(held_["new"].size(), static_cast<size_t>(limits_.leases_per_worker_max));
}

// Both hold the same tasks and deliver nothing.
TEST_F(StrangersTest, TwoHoardersKeepNoTaskFromOthers) {
  const uint64_t job = AddJob();
  ASSERT_FALSE(Sync("h1", 256).empty());
  for (size_t before = 0; Sync("old", 256).size() > before; before = held_["old"].size()) {
    while (held_["old"].size() > 1) Accept(held_["old"][0]);
  }
  ASSERT_EQ(Sync("h2", 1).size(), 1u) << "a hedge";
  while (!held_["old"].empty()) {
    Accept(held_["old"][0]);
    Sync("old", 1);
  }
  EXPECT_EQ(scheduler_.leases().size(), 2u) << "two hold one task, not yet for long";
  now_ += limits_.overdue_min;
  ASSERT_EQ(Sync("old", 1).size(), 1u);
  EXPECT_TRUE(Accept(held_["old"][0]));
  EXPECT_TRUE(scheduler_.Deliver({job, 1}));
}

TEST_F(StrangersTest, SceneErrorsOfStrangersEndNoJob) {
  const uint64_t job = AddJob();
  for (const char* id : {"x", "y", "z"}) FailOne(id, FailureKind::kScene);
  EXPECT_EQ(Job(job).phase, JobPhase::kLive);
  FailOne("old", FailureKind::kScene);
  EXPECT_EQ(Job(job).phase, JobPhase::kFailed);
  EXPECT_THAT(Job(job).failure, HasSubstr("says: x.pbrt:1:1: \\x1b[2J is bad"));
}

TEST_F(StrangersTest, ResultsContradictSceneErrors) {
  const uint64_t other = AddJob();
  Accept(Sync("a", 1).at(0));
  Accept(Sync("b", 1).at(0));
  scheduler_.EndJob(other, JobPhase::kCancelled, "");
  const uint64_t job = AddJob();
  Accept(Sync("old", 1).at(0));
  FailOne("a", FailureKind::kScene);
  FailOne("b", FailureKind::kScene);
  EXPECT_EQ(Job(job).phase, JobPhase::kLive);
}

TEST_F(StrangersTest, CrashesOfStrangersSetNothingAside) {
  const uint64_t job = AddJob();
  for (const char* id : {"x", "y", "z"}) FailOne(id, FailureKind::kInternal);
  EXPECT_EQ(scheduler_.counters().tasks_poisoned, 0u);
  FailOne("old", FailureKind::kInternal);
  EXPECT_EQ(scheduler_.counters().tasks_poisoned, 1u);
  EXPECT_EQ(Job(job).phase, JobPhase::kLive);
  EXPECT_THAT(IncompleteText(Job(job).frames[0]), HasSubstr("worker old says: "));
}

// No worker is left that may render the task, so no further failure reports it.
TEST_F(StrangersTest, CrashesOfAllCountOnceWorkersWithResultsAreGone) {
  const uint64_t job = AddJob();
  for (const char* id : {"x", "y", "z"}) FailOne(id, FailureKind::kInternal);
  scheduler_.Tick(now_);
  EXPECT_EQ(scheduler_.counters().tasks_poisoned, 0u);
  for (int half = 0; half < 3; ++half) {
    now_ += limits_.lease_duration / 2;  // So that old is lost, and they are not.
    for (const char* live : {"x", "y", "z"}) Sync(live, 0);
  }
  scheduler_.Tick(now_);
  EXPECT_EQ(scheduler_.counters().tasks_poisoned, 1u);
  EXPECT_THAT(IncompleteText(Job(job).frames[0]),
              HasSubstr("failed on x by a crash, y by a crash"));
}

// Several workers of one certificate are one voice.
TEST_F(StrangersTest, FailuresCountByIdentity) {
  identities_ = {{"a1", "a"}, {"a2", "a"}, {"old", ""}};
  const uint64_t first = AddJob();
  Accept(Sync("a1", 1).at(0));
  scheduler_.EndJob(first, JobPhase::kCancelled, "");
  const uint64_t job = AddJob();
  FailOne("a1", FailureKind::kScene);
  FailOne("a2", FailureKind::kScene);
  EXPECT_EQ(Job(job).phase, JobPhase::kLive);
  FailOne("old", FailureKind::kScene);
  EXPECT_EQ(Job(job).phase, JobPhase::kFailed);
}

TEST_F(StrangersTest, WorkerIdsBelongToOneIdentity) {
  identities_["a"] = "one";
  Sync("a", 1);
  EXPECT_TRUE(status_.ok());
  identities_["a"] = "two";
  Sync("a", 1);
  EXPECT_EQ(status_.code(), absl::StatusCode::kPermissionDenied);
}

TEST_F(StrangersTest, QuarantinesHoldForIdentitiesUntilTheyAreLifted) {
  AddJob();
  identities_ = {{"a1", "a"}, {"a2", "a"}};
  EXPECT_FALSE(Sync("a1", 1).empty());
  scheduler_.Quarantine("a", "it lies");
  scheduler_.Quarantine("a", "again");
  EXPECT_EQ(scheduler_.leases().size(), 0u);
  EXPECT_EQ(scheduler_.counters().workers_quarantined, 1u);
  Sync("a2", 1);
  EXPECT_EQ(status_.code(), absl::StatusCode::kPermissionDenied);
  EXPECT_THAT(std::string(status_.message()), HasSubstr("it lies"));
  const absl::Time stamp = absl::FromUnixSeconds(1'700'000'000);
  EXPECT_EQ(scheduler_.TakeQuarantines(stamp),
            (std::vector<QuarantineRecord>{{"a", "it lies", false, stamp}}));
  EXPECT_TRUE(scheduler_.TakeQuarantines(stamp).empty());
  EXPECT_TRUE(scheduler_.LiftQuarantine("a"));
  EXPECT_FALSE(scheduler_.LiftQuarantine("a"));
  EXPECT_FALSE(Sync("a1", 1).empty());
  Sync("a2", 1);
  EXPECT_TRUE(status_.ok());
}

TEST_F(StrangersTest, RestoredQuarantinesHold) {
  scheduler_.RestoreQuarantine({"a", "it lied", true, absl::FromUnixSeconds(1)});
  Sync("a", 1);
  EXPECT_EQ(status_.code(), absl::StatusCode::kPermissionDenied);
  EXPECT_TRUE(scheduler_.TakeQuarantines(absl::Now()).empty()) << "it is written down already";
}

}  // namespace
}  // namespace sheaf::coordinator
