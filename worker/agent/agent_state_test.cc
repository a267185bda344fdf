// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/agent_state.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace sheaf::worker {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;
using Stage = AgentState::Stage;

class AgentStateTest : public ::testing::Test {
 protected:
  AgentStateTest() {
    options_.thread_count = 1;
    options_.leases_ahead = 1;
    options_.grace = seconds(10);
    options_.farewell = seconds(3);
  }

  // One call of Synchronize, which grants these leases.
  AgentState::Report Synchronize(AgentState* state, const std::vector<uint64_t>& granted,
                                 bool exit = false, bool deliveries = false) {
    AgentState::Report report = state->BeginSynchronize(now_);
    DesiredState desired;
    desired.exit = exit;
    desired.deliveries = deliveries;
    for (const uint64_t id : granted) {
      Lease lease;
      lease.lease_id = id;
      desired.leases.push_back(lease);
    }
    state->TakeAnswer(report.sequence, desired, now_);
    return report;
  }
  // Renders the next lease as far as its result.
  static void Render(AgentState* state) {
    const std::optional<LeaseLedger::Task> task = state->TakeTask();
    ASSERT_TRUE(task.has_value());
    state->BeginRendering(task->lease.lease_id);
    FinishedPart part;
    part.lease_id = task->lease.lease_id;
    part.exr_bytes = "12345678";
    state->Finish(std::move(part));
  }

  AgentOptions options_;
  AgentState::Time now_{seconds(1'000)};
};

TEST_F(AgentStateTest, AsksForLeasesAheadAndForThoseInUpload) {
  AgentState state(options_, now_);
  EXPECT_TRUE(state.MustSynchronize(now_));
  EXPECT_EQ(Synchronize(&state, {1, 2}).state.requested_lease_count, 2);
  EXPECT_FALSE(state.MustSynchronize(now_));
  Render(&state);
  EXPECT_FALSE(state.MustSynchronize(now_ + options_.synchronize_spacing));  // Enough are ahead.
  state.TakeTask();
  state.TakeOutcomes({UploadOutcome::kAccepted});
  // Its delivery asks for a further lease at once, no sooner than the spacing permits.
  EXPECT_EQ(state.NextTurn(), now_ + options_.synchronize_spacing);
  now_ = state.NextTurn();
  EXPECT_THAT(Synchronize(&state, {2, 3}).state.leases,
              ElementsAre(LeaseReport{2, LeasePhase::kLoading}));
  Render(&state);
  EXPECT_EQ(Synchronize(&state, {2, 3}).state.requested_lease_count, 3);
}

TEST_F(AgentStateTest, NoTaskBeginsWithoutRoomForItsResult) {
  options_.unsent_bytes_max = 8;
  AgentState state(options_, now_);
  Synchronize(&state, {1, 2});
  Render(&state);
  EXPECT_FALSE(state.HasTask());
  ASSERT_THAT(state.NextUpload(), SizeIs(1));
  state.TakeOutcomes({UploadOutcome::kAccepted});
  EXPECT_TRUE(state.HasTask());
  EXPECT_EQ(state.counts().accepted, 1u);
}

TEST_F(AgentStateTest, ARefusedResultOfSeveralIsFoundAlone) {
  AgentState state(options_, now_);
  Synchronize(&state, {1, 2});
  Render(&state);
  Render(&state);
  ASSERT_THAT(state.NextUpload(), SizeIs(2));
  const absl::Status refused = absl::InvalidArgumentError("not a part");
  EXPECT_EQ(state.TakeUploadFailure(refused), milliseconds(0));
  ASSERT_THAT(state.NextUpload(), SizeIs(1));
  state.TakeUploadFailure(refused);
  EXPECT_EQ(state.counts().failed, 1u);
  ASSERT_THAT(state.NextUpload(), SizeIs(1));
  EXPECT_EQ(state.NextUpload()[0]->lease_id, 2u);
  state.TakeOutcomes({UploadOutcome::kAccepted});
  EXPECT_FALSE(state.HasParts());
}

// The coordinator offers that results come with the worker's report.
TEST_F(AgentStateTest, ADeliveryIsTheReport) {
  AgentState state(options_, now_);
  Synchronize(&state, {1, 2, 3}, /*exit=*/false, /*deliveries=*/true);
  Render(&state);
  Render(&state);
  // No call of Synchronize asks for the next leases.
  EXPECT_FALSE(state.MustSynchronize(now_ + options_.synchronize_spacing));
  ASSERT_TRUE(state.DeliversState());
  const AgentState::Report report = state.BeginDelivery(now_);
  EXPECT_EQ(report.state.requested_lease_count, options_.thread_count + options_.leases_ahead);
  EXPECT_FALSE(state.DeliversState());
  EXPECT_FALSE(state.MustSynchronize(now_ + seconds(5)));  // The report is under way.
  Delivery delivery{{UploadOutcome::kAccepted, UploadOutcome::kAccepted}, {}};
  delivery.desired.deliveries = true;
  for (const uint64_t id : {uint64_t{3}, uint64_t{4}}) {
    Lease lease;
    lease.lease_id = id;
    delivery.desired.leases.push_back(lease);
  }
  state.TakeDelivery(report.sequence, delivery, now_);
  EXPECT_EQ(state.counts().accepted, 2u);
  EXPECT_FALSE(state.HasParts());
  EXPECT_FALSE(state.MustSynchronize(now_ + options_.synchronize_spacing));  // Enough are ahead.
  EXPECT_TRUE(state.HasTask());
}

TEST_F(AgentStateTest, AfterAFailedDeliveryTheCallsAreMadeApart) {
  AgentState state(options_, now_);
  Synchronize(&state, {1, 2}, /*exit=*/false, /*deliveries=*/true);
  Render(&state);
  ASSERT_TRUE(state.DeliversState());
  state.BeginDelivery(now_);
  EXPECT_EQ(state.TakeDeliveryFailure(absl::UnavailableError("away")), options_.backoff_initial);
  EXPECT_TRUE(state.MustSynchronize(now_ + options_.synchronize_spacing));
  EXPECT_FALSE(state.DeliversState());
  Synchronize(&state, {1, 2}, /*exit=*/false, /*deliveries=*/true);
  EXPECT_FALSE(state.DeliversState());
  state.TakeOutcomes({UploadOutcome::kAccepted});
  Render(&state);
  EXPECT_TRUE(state.DeliversState());
}

TEST_F(AgentStateTest, ARefusedResultOfADeliveryIsFoundAlone) {
  AgentState state(options_, now_);
  Synchronize(&state, {1, 2}, /*exit=*/false, /*deliveries=*/true);
  Render(&state);
  Render(&state);
  state.BeginDelivery(now_);
  EXPECT_EQ(state.TakeDeliveryFailure(absl::InvalidArgumentError("not a part")), milliseconds(0));
  EXPECT_FALSE(state.DeliversState());
  EXPECT_THAT(state.NextUpload(), SizeIs(1));
}

// The report may be what is refused: the result is kept, and uploaded alone.
TEST_F(AgentStateTest, ARefusedDeliveryOfOneResultKeepsIt) {
  AgentState state(options_, now_);
  Synchronize(&state, {1, 2}, /*exit=*/false, /*deliveries=*/true);
  Render(&state);
  state.BeginDelivery(now_);
  EXPECT_EQ(state.TakeDeliveryFailure(absl::PermissionDeniedError("another certificate's id")),
            milliseconds(0));
  EXPECT_TRUE(state.HasParts());
  EXPECT_FALSE(state.DeliversState());
  state.TakeOutcomes({UploadOutcome::kDuplicateEqual});
  EXPECT_EQ(state.counts().failed, 0u);
  EXPECT_EQ(state.counts().duplicate_equal, 1u);
}

TEST_F(AgentStateTest, LargeResultsAreNoDelivery) {
  AgentState state(options_, now_);
  Synchronize(&state, {1}, /*exit=*/false, /*deliveries=*/true);
  const std::optional<LeaseLedger::Task> task = state.TakeTask();
  state.BeginRendering(1);
  FinishedPart part;
  part.lease_id = 1;
  for (int kib = 0; kib <= 1024; ++kib) part.exr_bytes += std::string(1024, 'x');
  state.Finish(std::move(part));
  EXPECT_FALSE(state.DeliversState());
  EXPECT_TRUE(state.MustSynchronize(now_ + options_.synchronize_spacing));
}

TEST_F(AgentStateTest, AttemptsAreFurtherAndFurtherApart) {
  AgentState state(options_, now_);
  milliseconds expected = options_.backoff_initial;
  for (int i = 0; i < 8; ++i) {
    state.BeginSynchronize(now_);
    state.TakeNoAnswer(absl::UnavailableError("away"), now_);
    EXPECT_EQ(state.NextTurn(), now_ + expected);
    EXPECT_EQ(state.TakeUploadFailure(absl::UnavailableError("away")), expected);
    expected = std::min(expected * 2, options_.backoff_max);
    now_ = state.NextTurn();
  }
  Synchronize(&state, {});
  state.BeginSynchronize(now_);
  state.TakeNoAnswer(absl::UnavailableError("away"), now_);
  EXPECT_EQ(state.NextTurn(), now_ + options_.backoff_initial);
}

TEST_F(AgentStateTest, AnotherVersionIsAskedSeldom) {
  AgentState state(options_, now_);
  state.BeginSynchronize(now_);
  state.TakeNoAnswer(absl::FailedPreconditionError("older"), now_);
  EXPECT_EQ(state.NextTurn(), now_ + options_.refused_backoff);
  EXPECT_TRUE(state.HasReported(state.ReportLoading()));  // No load is waited for.
}

TEST_F(AgentStateTest, LoadingIsReportedByTheNextAnswer) {
  AgentState state(options_, now_);
  Synchronize(&state, {1});
  const std::optional<LeaseLedger::Task> task = state.TakeTask();
  const uint64_t loading = state.ReportLoading();
  EXPECT_FALSE(state.HasReported(loading));
  EXPECT_THAT(Synchronize(&state, {1}).state.leases,
              ElementsAre(LeaseReport{1, LeasePhase::kLoading}));
  EXPECT_TRUE(state.HasReported(loading));
}

// A worker that is told to stop returns what it has not begun, delivers what it renders, and ends.
TEST_F(AgentStateTest, StopsInOrder) {
  AgentState state(options_, now_);
  Synchronize(&state, {1, 2});
  const std::optional<LeaseLedger::Task> running = state.TakeTask();
  state.BeginRendering(running->lease.lease_id);
  state.Advance(now_, true);
  EXPECT_EQ(state.stage(), Stage::kFinishing);
  EXPECT_FALSE(state.HasTask());
  now_ += seconds(1);
  const AgentState::Report report = Synchronize(&state, {1, 3});
  EXPECT_TRUE(report.state.draining);
  EXPECT_THAT(report.state.failures, SizeIs(1));
  EXPECT_FALSE(state.HasTask());  // 3 was granted too late, and is returned.
  FinishedPart part;
  part.lease_id = running->lease.lease_id;
  state.Finish(std::move(part));
  state.TakeOutcomes({UploadOutcome::kAccepted});
  state.Advance(now_, true);
  EXPECT_EQ(state.stage(), Stage::kFinishing);  // Lease 3 is not returned yet.
  now_ += seconds(1);
  Synchronize(&state, {});
  state.Advance(now_, true);
  EXPECT_EQ(state.stage(), Stage::kDone);
  EXPECT_TRUE(state.IsComplete());
}

TEST_F(AgentStateTest, ReturnsRunningTasksAfterTheGracePeriod) {
  AgentState state(options_, now_);
  Synchronize(&state, {1});
  const std::optional<LeaseLedger::Task> running = state.TakeTask();
  state.BeginRendering(1);
  state.Advance(now_, true);
  Synchronize(&state, {1});
  const AgentState::Time grace_end = now_ + options_.grace;
  EXPECT_LE(state.NextTurn(), grace_end);
  now_ = grace_end;
  state.Advance(now_, true);
  EXPECT_EQ(state.stage(), Stage::kReleasing);
  EXPECT_TRUE(running->stop.stop_requested());
  state.Fail(1, FailureKind::kReleased, absl::CancelledError("stopped"));
  EXPECT_TRUE(state.MustSynchronize(now_));
  Synchronize(&state, {});
  state.Advance(now_, true);
  EXPECT_EQ(state.stage(), Stage::kDone);
}

// Until then it waits, and does not ask again and again what is due.
TEST_F(AgentStateTest, DeadlinesThatHavePassedAreNotDue) {
  AgentState state(options_, now_);
  Synchronize(&state, {1});
  Render(&state);
  state.Advance(now_, true);
  Synchronize(&state, {1});
  EXPECT_EQ(state.NextUpload().size(), 1u);
  now_ += options_.grace;
  state.Advance(now_, true);
  Synchronize(&state, {1});
  EXPECT_NE(state.stage(), Stage::kDone);
  EXPECT_GT(state.NextTurn(), now_);

  AgentState away(options_, now_);
  Synchronize(&away, {1});
  away.TakeTask();
  away.SetAwayReason("the machine's owner is here");
  away.Advance(now_, false);
  now_ += options_.grace;
  away.Advance(now_, false);
  Synchronize(&away, {1});
  EXPECT_GT(away.NextTurn(), now_);
}

// Neither an absent coordinator nor a task that does not stop keeps it forever.
TEST_F(AgentStateTest, EndsWithoutACoordinatorAndWithoutItsTasks) {
  for (const bool is_running : {false, true}) {
    AgentState state(options_, now_);
    Synchronize(&state, {1});
    if (is_running) state.TakeTask();
    state.Advance(now_, true);
    const AgentState::Time begin = now_;
    while (state.stage() != Stage::kDone) {
      ASSERT_LE(now_ - begin, options_.grace + 2 * options_.farewell);
      if (state.MustSynchronize(now_)) {
        state.BeginSynchronize(now_);
        state.TakeNoAnswer(absl::UnavailableError("away"), now_);
      }
      now_ = std::max(now_ + milliseconds(1), state.NextTurn());
      state.Advance(now_, true);
    }
    EXPECT_FALSE(state.IsComplete());
    EXPECT_GE(now_ - begin, options_.grace);
  }
}

TEST_F(AgentStateTest, IsAwayWhileThereIsAReason) {
  AgentState state(options_, now_);
  Synchronize(&state, {1, 2});
  const std::optional<LeaseLedger::Task> running = state.TakeTask();
  state.SetAwayReason("the machine's owner is here");
  state.Advance(now_, false);
  EXPECT_EQ(state.stage(), Stage::kAway);
  EXPECT_FALSE(state.HasTask());
  EXPECT_FALSE(state.NeedsNoScene());
  EXPECT_EQ(Synchronize(&state, {1}).state.requested_lease_count, 0);
  now_ += options_.grace;
  state.Advance(now_, false);
  EXPECT_TRUE(running->stop.stop_requested());
  state.Fail(1, FailureKind::kReleased, absl::CancelledError("stopped"));
  EXPECT_TRUE(state.NeedsNoScene());
  state.SetAwayReason("");
  state.Advance(now_, false);
  EXPECT_EQ(state.stage(), Stage::kWorking);
  EXPECT_EQ(Synchronize(&state, {}).state.requested_lease_count, 2);
}

TEST_F(AgentStateTest, EndsWhenIdleForLongOrWhenTold) {
  options_.exit_when_idle = seconds(60);
  AgentState idle(options_, now_);
  Synchronize(&idle, {});
  const AgentState::Time end = now_ + seconds(60);
  EXPECT_LE(idle.NextTurn(), end);
  idle.Advance(end - milliseconds(1), false);
  EXPECT_EQ(idle.stage(), Stage::kWorking);
  idle.Advance(end, false);
  EXPECT_TRUE(idle.IsStopping());

  AgentState told(options_, now_);
  Synchronize(&told, {}, /*exit=*/true);
  told.Advance(now_, false);
  EXPECT_TRUE(told.IsStopping());
  EXPECT_THAT(Synchronize(&told, {}).state.failures, IsEmpty());
  told.Advance(now_, false);
  EXPECT_EQ(told.stage(), Stage::kDone);
}

}  // namespace
}  // namespace sheaf::worker
