// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/lease_ledger.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sheaf::worker {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

Lease MakeLease(uint64_t id) {
  Lease lease;
  lease.lease_id = id;
  return lease;
}

TEST(LeaseLedgerTest, TakesLeasesInOrder) {
  LeaseLedger ledger;
  EXPECT_EQ(ledger.Apply(ledger.TakeSnapshot().sequence, {MakeLease(9), MakeLease(3)}), 2);
  EXPECT_EQ(ledger.TakeNext()->lease.lease_id, 9u);
  EXPECT_EQ(ledger.TakeNext()->lease.lease_id, 3u);
  EXPECT_FALSE(ledger.TakeNext().has_value());
}

TEST(LeaseLedgerTest, RepeatedRepliesChangeNothing) {
  LeaseLedger ledger;
  const uint64_t sequence = ledger.TakeSnapshot().sequence;
  EXPECT_EQ(ledger.Apply(sequence, {MakeLease(1)}), 1);
  EXPECT_EQ(ledger.Apply(sequence, {MakeLease(1)}), 0);
  EXPECT_THAT(ledger.TakeSnapshot().leases, ElementsAre(LeaseReport{1, LeasePhase::kQueued}));
}

TEST(LeaseLedgerTest, DropsLeasesNoLongerListed) {
  LeaseLedger ledger;
  ledger.Apply(ledger.TakeSnapshot().sequence, {MakeLease(1), MakeLease(2)});
  const LeaseLedger::Task running = *ledger.TakeNext();
  ledger.Apply(ledger.TakeSnapshot().sequence, {});
  EXPECT_FALSE(ledger.HasQueued());
  EXPECT_TRUE(running.stop.stop_requested());
  ledger.Fail(1, FailureKind::kReleased, "stopped");
  EXPECT_TRUE(ledger.Empty());
  EXPECT_THAT(ledger.TakeSnapshot().failures, IsEmpty());
}

TEST(LeaseLedgerTest, KeepsFinishedPartsNoLongerListed) {
  LeaseLedger ledger;
  ledger.Apply(ledger.TakeSnapshot().sequence, {MakeLease(1)});
  ledger.TakeNext();
  ledger.BeginRendering(1);
  ledger.Apply(ledger.TakeSnapshot().sequence, {});  // A coordinator that forgot its leases.
  ledger.Finish(1);
  ledger.Apply(ledger.TakeSnapshot().sequence, {});
  EXPECT_EQ(ledger.CountHeld(LeasePhase::kUploading), 1);
  ledger.Acknowledge(1);
  EXPECT_TRUE(ledger.Empty());
}

TEST(LeaseLedgerTest, OldRepliesDoNotReviveEndedLeases) {
  LeaseLedger ledger;
  ledger.Apply(ledger.TakeSnapshot().sequence, {MakeLease(1)});
  ledger.TakeNext();
  ledger.BeginRendering(1);
  const uint64_t request = ledger.TakeSnapshot().sequence;
  ledger.Finish(1);
  ledger.Acknowledge(1);
  EXPECT_EQ(ledger.Apply(request, {MakeLease(1)}), 0);
  EXPECT_FALSE(ledger.HasQueued());
}

TEST(LeaseLedgerTest, RepeatsFailuresUntilAcknowledged) {
  LeaseLedger ledger;
  ledger.Apply(ledger.TakeSnapshot().sequence, {MakeLease(1)});
  ledger.TakeNext();
  const uint64_t before = ledger.TakeSnapshot().sequence;
  ledger.Fail(1, FailureKind::kScene, "room.pbrt:3:1: no");
  ledger.Apply(before, {MakeLease(1)});
  const LeaseFailure failure{1, FailureKind::kScene, "room.pbrt:3:1: no"};
  EXPECT_THAT(ledger.TakeSnapshot().failures, ElementsAre(failure));  // Its reply is lost.
  const LeaseLedger::Snapshot again = ledger.TakeSnapshot();
  EXPECT_THAT(again.failures, ElementsAre(failure));
  ledger.Apply(again.sequence, {});
  EXPECT_TRUE(ledger.Empty());
}

TEST(LeaseLedgerTest, ReleasesUnstartedLeases) {
  LeaseLedger ledger;
  ledger.Apply(ledger.TakeSnapshot().sequence, {MakeLease(1), MakeLease(2)});
  ledger.TakeNext();
  ledger.ReleaseQueued();
  const LeaseLedger::Snapshot snapshot = ledger.TakeSnapshot();
  EXPECT_THAT(snapshot.leases, ElementsAre(LeaseReport{1, LeasePhase::kLoading}));
  ASSERT_EQ(snapshot.failures.size(), 1u);
  EXPECT_EQ(snapshot.failures[0].lease_id, 2u);
  EXPECT_EQ(snapshot.failures[0].kind, FailureKind::kReleased);
}

}  // namespace
}  // namespace sheaf::worker
