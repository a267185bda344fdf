// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Which workers get the jobs that require a pool, tags or memory.
#include <string>
#include <vector>

#include "coordinator/scheduling/tests/scheduler_fixture.h"
#include "gmock/gmock.h"

namespace sheaf::coordinator {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr uint64_t kOneGib = uint64_t{1} << 30;

class SchedulerRequirementsTest : public SchedulerTest {
 protected:
  SchedulerRequirementsTest() : SchedulerTest(FewGroups()) {}
  static Limits FewGroups() {
    Limits limits = TrustingLimits();
    limits.requirement_groups_max = 3;
    return limits;
  }
  JobSpec SpecOf(const Requirements& requirements) {
    JobSpec job;
    job.job_id = ++last_job_id_;
    job.numeric_profile = kProfile;
    job.partition = {32, 16, 1};
    job.requirements = requirements;
    job.frames.push_back(Frame(1, "scene", job.job_id * 100 + 1));
    return job;
  }
  uint64_t Add(const Requirements& requirements) {
    const JobSpec job = SpecOf(requirements);
    EXPECT_TRUE(scheduler_.CheckJob(job).ok());
    scheduler_.AddJob(job);
    return job.job_id;
  }
  // The jobs of the leases that the worker then holds.
  std::vector<uint64_t> Work(const std::string& id, const WorkerTraits& traits, int wanted = 1,
                             const std::vector<LeaseFailure>& failures = {}) {
    WorkerReport report;
    report.worker_id = report.host = id;
    report.numeric_profile = kProfile;
    report.traits = traits;
    report.requested_lease_count = wanted;
    report.failures = failures;
    const auto answer = scheduler_.Synchronize(report, now_);
    EXPECT_TRUE(answer.ok()) << answer.status();
    std::vector<uint64_t> jobs;
    for (const Lease& lease : answer->leases) jobs.push_back(lease.frame.job_id);
    last_lease_ = answer->leases.empty() ? 0 : answer->leases.back().lease_id;
    return jobs;
  }

  uint64_t last_lease_ = 0;
};

TEST_F(SchedulerRequirementsTest, JobsGoToWorkersOfTheirPoolWithTheirTags) {
  const uint64_t plain = Add({}), pooled = Add({"big", {}, 0, 0});
  const uint64_t tagged = Add({kDefaultPool, {"ssd"}, 0, 0});
  EXPECT_EQ(Work("a", {"big", {}, 0}), std::vector<uint64_t>{pooled});
  EXPECT_EQ(Work("b", {}), std::vector<uint64_t>{plain});
  const std::vector<uint64_t> both = Work("c", {kDefaultPool, {"avx", "ssd"}, 0}, 4);
  EXPECT_THAT(both, ::testing::Contains(plain));
  EXPECT_THAT(both, ::testing::Contains(tagged));
  EXPECT_THAT(both, ::testing::Not(::testing::Contains(pooled)));
}

// Neither first leases nor hedges of what others hold.
TEST_F(SchedulerRequirementsTest, WorkersThatDoNotFitGetNothing) {
  const uint64_t job = Add({kDefaultPool, {"ssd"}, 8 * kOneGib, 0});
  EXPECT_THAT(Work("a", {kDefaultPool, {}, 9 * kOneGib}), IsEmpty());
  EXPECT_THAT(scheduler_.WaitingReason(Job(job)), HasSubstr("has the tag \"ssd\""));
  EXPECT_THAT(Work("b", {kDefaultPool, {"ssd"}, 4 * kOneGib}), IsEmpty());
  EXPECT_THAT(scheduler_.WaitingReason(Job(job)), HasSubstr("8.0 GiB of memory"));
  EXPECT_EQ(Work("c", {kDefaultPool, {"ssd"}, 8 * kOneGib}, 99).size(), 16u);
  EXPECT_THAT(Work("a", {kDefaultPool, {}, 9 * kOneGib}), IsEmpty()) << "no hedge";
  EXPECT_EQ(scheduler_.WaitingReason(Job(job)), "");
}

TEST_F(SchedulerRequirementsTest, WorkersWithTooLittleMemoryComeLast) {
  const uint64_t job = Add({kDefaultPool, {}, 0, 9 * kOneGib});
  const WorkerTraits small{kDefaultPool, {}, 4 * kOneGib}, large{kDefaultPool, {}, 16 * kOneGib};
  EXPECT_EQ(Work("a", small), std::vector<uint64_t>{job}) << "there is no other";
  EXPECT_EQ(Work("b", large), std::vector<uint64_t>{job});
  EXPECT_EQ(Work("a", small, 2).size(), 1u) << "it keeps its lease and gets no further one";
  EXPECT_EQ(Work("b", large, 2).size(), 2u);
  now_ += limits_.lease_duration + absl::Seconds(1);
  EXPECT_EQ(Work("a", small, 3).size(), 3u) << "the large one is lost";
}

// A worker that failed for its disk gets the task again where no other one can have it.
TEST_F(SchedulerRequirementsTest, WorkersOfOtherPoolsAreNoOthers) {
  const uint64_t job = Add({"big", {}, 0, 0});
  const WorkerTraits big{"big", {}, 0};
  Work("other", {});
  ASSERT_EQ(Work("a", big), std::vector<uint64_t>{job});
  const uint64_t failed = last_lease_;
  Work("a", big, 0, {{failed, FailureKind::kInfrastructure, "disk"}});
  now_ += absl::Seconds(20);
  Work("other", {}, 0);
  EXPECT_EQ(Work("a", big, 16).size(), 16u) << "the failed task, too";
}

TEST_F(SchedulerRequirementsTest, ThereAreFewDifferentRequirements) {
  Add({});
  const uint64_t second = Add({"one", {}, 0, 0});
  Add({"two", {}, 0, 0});
  EXPECT_TRUE(scheduler_.CheckJob(SpecOf({"two", {}, 0, 0})).ok());
  EXPECT_TRUE(absl::IsResourceExhausted(scheduler_.CheckJob(SpecOf({"three", {}, 0, 0}))));
  scheduler_.EndJob(second, JobPhase::kCancelled, "");
  EXPECT_TRUE(scheduler_.CheckJob(SpecOf({"three", {}, 0, 0})).ok());
}

}  // namespace
}  // namespace sheaf::coordinator
