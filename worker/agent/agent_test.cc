// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/agent.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>
#include <map>
#include <set>
#include <thread>
#include <utility>

#include "tests/support/farm/agent_fixture.h"

namespace sheaf::worker {
namespace {

TEST(AgentTest, RendersAllTasks) {
  FakeCoordinator coordinator(100);
  FakeRenderer renderer;
  Running running(FastOptions(), &coordinator, &renderer);
  EXPECT_TRUE(Eventually([&] { return coordinator.done_count() == 100; }));
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_EQ(running.agent().counts().accepted, 100u);
  EXPECT_TRUE(coordinator.last_was_draining_and_empty());
}

TEST(AgentTest, LostRepliesLoseNoWork) {
  FakeCoordinator coordinator(100);
  coordinator.LoseEveryReply(3);
  FakeRenderer renderer;
  Running running(FastOptions(), &coordinator, &renderer);
  EXPECT_TRUE(Eventually([&] { return coordinator.done_count() == 100; }));
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_EQ(running.agent().counts().accepted + running.agent().counts().duplicate_equal, 100u);
  EXPECT_TRUE(coordinator.failures().empty());
}

TEST(AgentTest, DeliversResultsWithItsReport) {
  FakeCoordinator coordinator(100);
  coordinator.OfferDeliveries();
  FakeRenderer renderer;
  Running running(FastOptions(), &coordinator, &renderer);
  EXPECT_TRUE(Eventually([&] { return coordinator.done_count() == 100; }));
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_EQ(running.agent().counts().accepted, 100u);
  EXPECT_GT(coordinator.delivery_count(), 0);
  EXPECT_TRUE(coordinator.last_was_draining_and_empty());
}

TEST(AgentTest, LostRepliesOfDeliveriesLoseNoWork) {
  FakeCoordinator coordinator(100);
  coordinator.OfferDeliveries();
  coordinator.LoseEveryReply(3);
  FakeRenderer renderer;
  Running running(FastOptions(), &coordinator, &renderer);
  EXPECT_TRUE(Eventually([&] { return coordinator.done_count() == 100; }));
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_EQ(running.agent().counts().accepted + running.agent().counts().duplicate_equal, 100u);
  EXPECT_TRUE(coordinator.failures().empty());
}

TEST(AgentTest, CoordinatorRestartLosesNoPart) {
  FakeCoordinator coordinator(20);
  FakeRenderer renderer;
  renderer.gate_open = false;
  Running running(FastOptions(), &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 2; }));
  coordinator.set_away(true);
  coordinator.ForgetLeases();
  renderer.gate_open = true;  // Leased tasks are rendered although the coordinator does not answer.
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 0; }));
  coordinator.set_away(false);
  EXPECT_TRUE(Eventually([&] { return coordinator.done_count() == 20; }));
  EXPECT_TRUE(running.Stop().ok());
}

TEST(AgentTest, CancelWhileRenderingStopsTheThreads) {
  FakeCoordinator coordinator(20);
  FakeRenderer renderer;
  renderer.gate_open = false;
  Running running(FastOptions(), &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 2; }));
  coordinator.CancelEverything();
  EXPECT_TRUE(Eventually([&] { return renderer.rendering_count == 0; }));
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_TRUE(coordinator.failures().empty());
}

TEST(AgentTest, TermFinishesTasksWithinTheGracePeriod) {
  FakeCoordinator coordinator(20);
  FakeRenderer renderer;
  renderer.gate_open = false;
  AgentOptions options = FastOptions();
  options.grace = std::chrono::seconds(20);
  Running running(options, &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 2; }));
  std::jthread opener([&] {
    Eventually([&] { return coordinator.failures().size() == 2; });  // Queued leases are returned.
    renderer.gate_open = true;
  });
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_EQ(coordinator.done_count(), 2u);
  for (const LeaseFailure& failure : coordinator.failures()) {
    EXPECT_EQ(failure.kind, FailureKind::kReleased);
  }
}

TEST(AgentTest, EndsByItselfWhereTheCoordinatorSaysSo) {
  FakeCoordinator coordinator(20);
  FakeRenderer renderer;
  Running running(FastOptions(), &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return coordinator.done_count() > 0; }));
  coordinator.TellToExit();
  EXPECT_TRUE(running.Join().ok());
  EXPECT_TRUE(coordinator.last_was_draining_and_empty());
}

TEST(AgentTest, TermReleasesTasksBeyondTheGracePeriod) {
  FakeCoordinator coordinator(20);
  FakeRenderer renderer;
  renderer.gate_open = false;
  Running running(FastOptions(), &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 2; }));
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_EQ(coordinator.done_count(), 0u);
  EXPECT_EQ(coordinator.failures().size(), 4u);  // Two in threads, two ahead.
  EXPECT_TRUE(coordinator.last_was_draining_and_empty());
}

TEST(AgentTest, TermWithoutACoordinatorEndsAfterTheGracePeriod) {
  FakeCoordinator coordinator(20);
  FakeRenderer renderer;
  renderer.gate_open = false;
  Running running(FastOptions(), &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 2; }));
  coordinator.set_away(true);
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(running.Stop().code(), absl::StatusCode::kUnavailable);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(200));
}

// Regression: the thread that sends results tried without a pause and never ended.
TEST(AgentTest, TermEndsWithResultsThatNoCoordinatorTakes) {
  FakeCoordinator coordinator(20);
  FakeRenderer renderer;
  renderer.gate_open = false;
  Running running(FastOptions(), &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 2; }));
  coordinator.set_away(true);
  renderer.gate_open = true;
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 0; }));
  EXPECT_EQ(running.Stop().code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(coordinator.done_count(), 0u);
}

TEST(AgentTest, ClassifiesLoadFailures) {
  FakeCoordinator coordinator(1);
  FakeRenderer renderer;
  renderer.load_status = absl::InvalidArgumentError("room.pbrt:3:1: no such material");
  renderer.load_failure_kind = FailureKind::kScene;
  Running running(FastOptions(), &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return coordinator.failures().size() == 1; }));
  EXPECT_EQ(coordinator.failures()[0].kind, FailureKind::kScene);
  EXPECT_EQ(coordinator.failures()[0].message, "room.pbrt:3:1: no such material");
  EXPECT_TRUE(running.Stop().ok());
}

TEST(AgentTest, OutOfMemoryFailsOnlyTheTask) {
  for (const bool while_loading : {true, false}) {
    FakeCoordinator coordinator(2);
    FakeRenderer renderer;
    std::atomic<int> calls{0};
    const auto lack_once = [&] {
      if (calls++ == 0) throw std::bad_alloc();
    };
    (while_loading ? renderer.on_load : renderer.on_render) = lack_once;
    AgentOptions options = FastOptions();
    options.thread_count = 1;
    Running running(options, &coordinator, &renderer);
    EXPECT_TRUE(Eventually(
        [&] { return coordinator.failures().size() == 1 && coordinator.done_count() == 1; }));
    EXPECT_EQ(coordinator.failures()[0].kind, FailureKind::kMemory);
    EXPECT_THAT(coordinator.failures()[0].message,
                ::testing::HasSubstr(while_loading ? "loading the scene" : "rendering"));
    EXPECT_TRUE(running.Stop().ok());
  }
}

TEST(AgentTest, ScenesThatFailAreReloaded) {
  const std::pair<absl::Status, FailureKind> failures[] = {
      {absl::AbortedError("the coordinator has another guiding field"), FailureKind::kReleased},
      {absl::UnavailableError("no guiding field arrives"), FailureKind::kInfrastructure},
      {absl::DataLossError("file a.png was altered"), FailureKind::kInfrastructure},
      {absl::ResourceExhaustedError("its process was killed"), FailureKind::kMemory},
      {absl::InternalError("its process crashed"), FailureKind::kInternal}};
  for (const auto& [status, kind] : failures) {
    FakeCoordinator coordinator(2);
    FakeRenderer renderer;
    std::atomic<int> loads{0};
    renderer.on_load = [&] { ++loads; };
    renderer.render_status = status;
    AgentOptions options = FastOptions();
    options.thread_count = 1;
    Running running(options, &coordinator, &renderer);
    const size_t done = kind == FailureKind::kReleased ? 2 : 1;  // Both, for it is leased again.
    EXPECT_TRUE(Eventually(
        [&] { return coordinator.failures().size() == 1 && coordinator.done_count() == done; }));
    EXPECT_EQ(coordinator.failures()[0].kind, kind) << status;
    EXPECT_EQ(coordinator.failures()[0].message, status.message());
    EXPECT_EQ(loads, absl::IsUnavailable(status) ? 1 : 2) << "a scene without field stays good";
    EXPECT_TRUE(running.Stop().ok());
  }
}

TEST(AgentTest, LoadsAreReportedBeforeTheyBegin) {
  FakeCoordinator coordinator(1);
  FakeRenderer renderer;
  bool known = false;
  renderer.on_load = [&] { known = coordinator.last_was_loading(); };
  Running running(FastOptions(), &coordinator, &renderer);
  EXPECT_TRUE(Eventually([&] { return coordinator.done_count() == 1; }));
  EXPECT_TRUE(known);
  EXPECT_TRUE(running.Stop().ok());
}

TEST(AgentTest, RefusedPartsDoNotBlockOthers) {
  FakeCoordinator coordinator(30);
  coordinator.Refuse(7);
  FakeRenderer renderer;
  Running running(FastOptions(), &coordinator, &renderer);
  EXPECT_TRUE(Eventually(
      [&] { return coordinator.done_count() == 29 && coordinator.failures().size() == 1; }));
  EXPECT_EQ(coordinator.failures()[0].kind, FailureKind::kInternal);
  EXPECT_TRUE(running.Stop().ok());
}

TEST(AgentTest, FullOutboxDelaysNewTasks) {
  FakeCoordinator coordinator(50);
  FakeRenderer renderer;
  renderer.gate_open = false;
  renderer.part_bytes = 1000;
  AgentOptions options = FastOptions();
  options.unsent_bytes_max = 1500;
  Running running(options, &coordinator, &renderer);
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 2; }));
  coordinator.set_away(true);
  renderer.gate_open = true;
  ASSERT_TRUE(Eventually([&] { return renderer.rendering_count == 0; }));
  EXPECT_EQ(coordinator.done_count(), 0u);
  coordinator.set_away(false);
  EXPECT_TRUE(Eventually([&] { return coordinator.done_count() == 50; }));
  EXPECT_TRUE(running.Stop().ok());
}

TEST(AgentTest, EndsAfterTheIdleTimeout) {
  FakeCoordinator coordinator(5);
  FakeRenderer renderer;
  AgentOptions options = FastOptions();
  options.exit_when_idle = milliseconds(1000);  // Longer than any wait for the next task.
  Running running(options, &coordinator, &renderer);
  EXPECT_TRUE(running.Join().ok());
  EXPECT_EQ(coordinator.done_count(), 5u);
}

TEST(AgentTest, BacksOffWithoutACoordinator) {
  FakeCoordinator coordinator(1);
  coordinator.set_away(true);
  FakeRenderer renderer;
  AgentOptions options = FastOptions();
  options.backoff_initial = options.backoff_max = milliseconds(50);
  const auto begin = std::chrono::steady_clock::now();
  Running running(options, &coordinator, &renderer);
  EXPECT_TRUE(Eventually([&] { return coordinator.synchronize_count() >= 4; }));
  const int count = coordinator.synchronize_count();
  EXPECT_LE((count - 1) * options.backoff_max, std::chrono::steady_clock::now() - begin);
  EXPECT_TRUE(running.Stop().ok());
}

// The coordinator or the worker must be replaced; meanwhile the worker keeps what it has.
TEST(AgentTest, SaysOnceThatItsVersionIsRefusedAndTriesAgain) {
  FakeCoordinator coordinator(3);
  coordinator.set_is_of_another_version(true);
  FakeRenderer renderer;
  AgentOptions options = FastOptions();
  options.refused_backoff = milliseconds(60);
  testing::internal::CaptureStderr();
  const auto begin = std::chrono::steady_clock::now();
  Running running(options, &coordinator, &renderer);
  EXPECT_TRUE(Eventually([&] { return coordinator.synchronize_count() >= 3; }));
  const int count = coordinator.synchronize_count();
  EXPECT_LE((count - 1) * options.refused_backoff, std::chrono::steady_clock::now() - begin)
      << "the other back-off is at most 5 ms";
  coordinator.set_is_of_another_version(false);
  EXPECT_TRUE(Eventually([&] { return coordinator.done_count() == 3; }));
  EXPECT_TRUE(running.Stop().ok());
  const std::string log = testing::internal::GetCapturedStderr();
  const std::string words = "this program is older; trying again every 60ms";
  ASSERT_NE(log.find(words), std::string::npos) << log;
  EXPECT_EQ(log.find(words), log.rfind(words)) << log;
}

}  // namespace
}  // namespace sheaf::worker
