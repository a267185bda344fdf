// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/sharing/fair_share.h"

#include <map>
#include <string>
#include <vector>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::ElementsAre;

class FairShareTest : public ::testing::Test {
 protected:
  void Add(uint64_t id, const std::string& show, const std::string& user, int group = 0,
           int32_t priority = 0) {
    shares_.AddJob({id, "p", priority, show, user, group});
    shares_.SetReady(id, true);
  }
  std::vector<uint64_t> Offer(size_t count, const std::vector<int>& groups = {0}) {
    return shares_.Offer(
        "p", groups,
        [&](ShareKind kind, const std::string& name) {
          return refused_ != ShareSubject{kind, name};
        },
        count);
  }
  // Leases from the first job, and ends the lease at once where it costs something.
  uint64_t Serve(absl::Duration cpu, const std::vector<int>& groups = {0}) {
    const std::vector<uint64_t> first = Offer(1, groups);
    if (first.empty()) return 0;
    shares_.Grant(++last_lease_, first[0], 1000, 1);
    if (cpu > absl::ZeroDuration()) shares_.Deliver(last_lease_, cpu, absl::InfiniteDuration());
    return first[0];
  }
  std::map<uint64_t, int> ServeMany(int count, absl::Duration cpu) {
    std::map<uint64_t, int> counts;
    for (int i = 0; i < count; ++i) ++counts[Serve(cpu)];
    return counts;
  }

  FairShare shares_{Limits()};
  ShareSubject refused_{ShareKind::kPool, ""};
  uint64_t last_lease_ = 0;
};

TEST_F(FairShareTest, ShowsThenUsersThenJobsShare) {
  Add(1, "comet", "anna");
  Add(2, "comet", "anna");
  Add(3, "comet", "ben");
  Add(4, "dune", "ben");
  const auto counts = ServeMany(800, absl::Seconds(1));
  EXPECT_EQ(counts, (std::map<uint64_t, int>{{1, 100}, {2, 100}, {3, 200}, {4, 400}}));
}

TEST_F(FairShareTest, WeightsAndPrioritiesDecide) {
  Add(1, "s", "anna");
  Add(2, "s", "ben");
  shares_.SetWeight({ShareKind::kUser, "anna"}, 3);
  EXPECT_EQ(ServeMany(400, absl::Seconds(1)), (std::map<uint64_t, int>{{1, 300}, {2, 100}}));
  shares_.ResetWeight({ShareKind::kUser, "anna"});
  EXPECT_EQ(ServeMany(400, absl::Seconds(1)), (std::map<uint64_t, int>{{1, 200}, {2, 200}}));
  shares_.SetPriority(2, 5);
  EXPECT_EQ(ServeMany(10, absl::Seconds(1)), (std::map<uint64_t, int>{{2, 10}}));
  EXPECT_THAT(Offer(9), ElementsAre(2, 1));
  shares_.SetPriority(2, 0);
  const auto counts = ServeMany(10, absl::Seconds(1));
  EXPECT_EQ(counts, (std::map<uint64_t, int>{{1, 5}, {2, 5}})) << "no debt of another priority";
}

// Cheap and expensive samples get equal time.
TEST_F(FairShareTest, TimeIsSharedNotSamples) {
  Add(1, "s", "cheap");
  Add(2, "s", "expensive");
  double seconds[3] = {};
  for (int i = 0; i < 1100; ++i) {
    const uint64_t job = Offer(1)[0];
    const absl::Duration cost = absl::Seconds(job == 1 ? 1 : 10);
    shares_.Grant(++last_lease_, job, 1000, 1);
    shares_.NoteCost(job, 1000, cost);
    shares_.Deliver(last_lease_, cost, absl::InfiniteDuration());
    seconds[job] += absl::ToDoubleSeconds(cost);
  }
  EXPECT_NEAR(seconds[1] / seconds[2], 1, 0.02);
  EXPECT_DOUBLE_EQ(shares_.ExpectedSeconds(2, 500), 5);
}

TEST_F(FairShareTest, NewcomersAndThoseWhoComeBackHaveNoClaim) {
  Add(1, "s", "anna");
  ServeMany(100, absl::Seconds(1));
  Add(2, "s", "ben");
  EXPECT_EQ(ServeMany(10, absl::Seconds(1)), (std::map<uint64_t, int>{{1, 5}, {2, 5}}));
  shares_.SetReady(2, false);
  ServeMany(100, absl::Seconds(1));
  shares_.SetReady(2, true);
  EXPECT_EQ(ServeMany(10, absl::Seconds(1)), (std::map<uint64_t, int>{{1, 5}, {2, 5}}));
}

// A user who submits one small job after another pays for the earlier ones.
TEST_F(FairShareTest, EndedJobsLeaveTheirDebtToTheirUser) {
  Add(1, "s", "anna");
  Add(2, "s", "ben");
  ServeMany(2, absl::Seconds(1));
  const uint64_t job = Serve(absl::ZeroDuration());
  ASSERT_EQ(job, 1u);
  shares_.Deliver(last_lease_, absl::Seconds(50), absl::InfiniteDuration());
  shares_.RemoveJob(1);
  Add(3, "s", "anna");
  EXPECT_EQ(ServeMany(50, absl::Seconds(1)), (std::map<uint64_t, int>{{2, 50}}));
  EXPECT_GT(ServeMany(10, absl::Seconds(1))[3], 3);
}

TEST_F(FairShareTest, RunningLeasesAreChargedByTheTimeTheyAreHeld) {
  Add(1, "s", "anna");
  Add(2, "s", "ben");
  const SteadyTime begin{};
  ASSERT_EQ(Serve(absl::ZeroDuration()), 1u);
  const uint64_t hanging = last_lease_;
  shares_.Run(hanging, begin);
  EXPECT_EQ(Serve(absl::Seconds(1)), 2u);
  shares_.Run(hanging, begin + absl::Seconds(20));
  EXPECT_DOUBLE_EQ(shares_.ShareOfJob(1), 20);
  EXPECT_EQ(ServeMany(10, absl::Seconds(1)), (std::map<uint64_t, int>{{2, 10}}));
  shares_.End(hanging, begin + absl::Seconds(25));
  EXPECT_DOUBLE_EQ(shares_.ShareOfJob(1), 25);
  shares_.End(hanging, begin + absl::Seconds(90));
  EXPECT_DOUBLE_EQ(shares_.ShareOfJob(1), 25) << "it has ended once";
  // One that was never seen running costs nothing.
  ASSERT_EQ(Serve(absl::ZeroDuration()), 2u);
  const double before = shares_.ShareOfJob(2);
  shares_.End(last_lease_, begin + absl::Seconds(99));
  EXPECT_LT(shares_.ShareOfJob(2), before);
}

TEST_F(FairShareTest, LimitsAndGroupsLetOthersPass) {
  for (uint64_t id = 1; id <= 200; ++id) Add(id, "s", "anna", /*group=*/1);
  Add(201, "s", "ben");
  Add(202, "t", "ben");
  EXPECT_EQ(Offer(1)[0], 201u);
  EXPECT_THAT(Offer(12, {0, 1}), ::testing::Contains(202u)) << "after a few of anna's";
  EXPECT_EQ(Offer(1, {1})[0], 1u);
  refused_ = {ShareKind::kShow, "s"};
  EXPECT_THAT(Offer(9, {0, 1}), ElementsAre(202));
  refused_ = {ShareKind::kUser, "ben"};
  EXPECT_THAT(Offer(9), ElementsAre());
}

// A user held back by a limit does not take the whole farm afterwards.
TEST_F(FairShareTest, CatchingUpIsBounded) {
  Add(1, "s", "anna");
  Add(2, "s", "ben");
  refused_ = {ShareKind::kUser, "anna"};
  EXPECT_EQ(ServeMany(10'000, absl::Seconds(1)), (std::map<uint64_t, int>{{2, 10'000}}));
  Add(3, "s", "eve");
  refused_ = {};
  const auto counts = ServeMany(100, absl::Seconds(1));
  EXPECT_GE(counts.at(2), 25);
  EXPECT_GE(counts.at(3), 25);
  EXPECT_LE(counts.at(1), 50);
}

TEST_F(FairShareTest, MovedJobsTakeTheirLeasesAlong) {
  Add(1, "s", "anna");
  ASSERT_EQ(Serve(absl::ZeroDuration()), 1u);
  shares_.SetPriority(1, 7);
  const double moved = shares_.ShareOfJob(1);
  shares_.Deliver(last_lease_, absl::Seconds(9), absl::InfiniteDuration());
  EXPECT_EQ(shares_.ShareOfJob(1), moved) << "it was charged elsewhere";
  shares_.RemoveJob(1);
  EXPECT_THAT(Offer(9), ElementsAre());
  Add(1, "s", "anna");
  EXPECT_THAT(Offer(9), ElementsAre(1));
}

}  // namespace
}  // namespace sheaf::coordinator
