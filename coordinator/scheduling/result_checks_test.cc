// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/result_checks.h"

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf::coordinator {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using VerdictKind = CheckVerdict::Kind;

const TaskId kTask{{1, 1}, 2, 0, 16, 1};

TEST(ResultChecksTest, TwoThatAgreeConfirm) {
  ResultChecks checks(5);
  checks.Begin(kTask, {"a", "x"});
  EXPECT_EQ(checks.waiting().size(), 1u);
  EXPECT_EQ(checks.Add(kTask, {"a", "x"}, {"b", "x"}).kind, VerdictKind::kConfirmed);
  EXPECT_EQ(checks.size(), 0u);
  EXPECT_TRUE(checks.waiting().empty());
}

TEST(ResultChecksTest, AThirdDecidesDisputes) {
  for (const bool first_lies : {false, true}) {
    ResultChecks checks(5);
    EXPECT_EQ(checks.Add(kTask, {"a", "x"}, {"b", "y"}).kind, VerdictKind::kOpen);
    EXPECT_TRUE(checks.HasDispute({1, 1}));
    const CheckVerdict verdict = checks.Add(kTask, {"a", "x"}, {"c", first_lies ? "y" : "x"});
    EXPECT_EQ(verdict.kind, VerdictKind::kDecided);
    EXPECT_THAT(verdict.liars, ElementsAre(first_lies ? "a" : "b"));
    EXPECT_EQ(checks.size(), 0u);
  }
}

TEST(ResultChecksTest, ManyThatDifferStayUndecided) {
  ResultChecks checks(4);
  EXPECT_EQ(checks.Add(kTask, {"a", "1"}, {"b", "2"}).kind, VerdictKind::kOpen);
  EXPECT_EQ(checks.Add(kTask, {"a", "1"}, {"c", "3"}).kind, VerdictKind::kOpen);
  EXPECT_EQ(checks.Add(kTask, {"a", "1"}, {"d", "4"}).kind, VerdictKind::kUndecided);
  EXPECT_EQ(checks.size(), 0u);
}

TEST(ResultChecksTest, NobodyVotesTwice) {
  ResultChecks checks(5);
  EXPECT_EQ(checks.Add(kTask, {"a", "x"}, {"b", "y"}).kind, VerdictKind::kOpen);
  EXPECT_EQ(checks.Add(kTask, {"a", "x"}, {"b", "y"}).kind, VerdictKind::kOpen);
  EXPECT_FALSE(checks.Find(kTask)->MayBeDoneBy("b"));
  EXPECT_TRUE(checks.Find(kTask)->MayBeDoneBy("c"));
  const CheckVerdict verdict = checks.Add(kTask, {"a", "x"}, {"b", "z"});
  EXPECT_EQ(verdict.kind, VerdictKind::kDecided) << "it contradicts itself";
  EXPECT_THAT(verdict.liars, ElementsAre("b"));
}

TEST(ResultChecksTest, RepeatedUploadsAreNoChecks) {
  ResultChecks checks(5);
  EXPECT_EQ(checks.Add(kTask, {"a", "x"}, {"a", "x"}).kind, VerdictKind::kOpen);
  EXPECT_EQ(checks.size(), 0u);
}

TEST(ResultChecksTest, LeasesComeAndGo) {
  ResultChecks checks(5);
  checks.Begin(kTask, {"a", "x"});
  checks.Lease(kTask);
  EXPECT_THAT(checks.waiting(), IsEmpty());
  checks.Avoid(kTask, "b");
  checks.Return(kTask);
  EXPECT_THAT(checks.waiting(), ElementsAre(kTask));
  EXPECT_FALSE(checks.Find(kTask)->MayBeDoneBy("b"));
  checks.Erase(kTask);
  checks.Return(kTask);
  EXPECT_THAT(checks.waiting(), IsEmpty()) << "it is over";
}

TEST(ResultChecksTest, FramesTakeTheirChecksAlong) {
  ResultChecks checks(5);
  const TaskId other{{1, 2}, 0, 0, 16, 1};
  checks.Begin(kTask, {"a", "x"});
  checks.Begin(other, {"a", "x"});
  EXPECT_EQ(checks.OfFrame({1, 1}).size(), 1u);
  checks.EraseFrame({1, 1});
  EXPECT_EQ(checks.size(), 1u);
  EXPECT_FALSE(checks.HasDispute({1, 2}));
  checks.Add(other, {"a", "x"}, {"b", "y"});
  EXPECT_TRUE(checks.HasDispute({1, 2}));
  checks.EraseFrame({1, 2});
  EXPECT_THAT(checks.waiting(), IsEmpty());
}

}  // namespace
}  // namespace sheaf::coordinator
