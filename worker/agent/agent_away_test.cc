// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A worker whose machine has a user for a while.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>

#include "tests/support/farm/agent_fixture.h"

namespace sheaf::worker {
namespace {

class AgentAwayTest : public ::testing::Test {
 protected:
  AgentAwayTest() {
    options_.away_interval = milliseconds(2);
    options_.why_away = [this](uint64_t scene_bytes) {
      ++asked_;
      scene_bytes_ = scene_bytes;
      return away_ ? "a user is here" : "";
    };
  }

  AgentOptions options_ = FastOptions();
  FakeCoordinator coordinator_{20};
  FakeRenderer renderer_;
  std::atomic<bool> away_{false};
  std::atomic<int> asked_{0};
  std::atomic<uint64_t> scene_bytes_{0};
};

TEST_F(AgentAwayTest, TakesNothingUntilItMay) {
  away_ = true;
  Running running(options_, &coordinator_, &renderer_);
  EXPECT_TRUE(Eventually([&] { return coordinator_.last_was_draining_and_empty(); }));
  EXPECT_TRUE(Eventually([&] { return asked_ > 10; }));
  EXPECT_EQ(coordinator_.done_count(), 0u);
  away_ = false;
  EXPECT_TRUE(Eventually([&] { return coordinator_.done_count() == 20; }));
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_TRUE(coordinator_.failures().empty());
}

TEST_F(AgentAwayTest, RunningTasksFinishWithinTheGracePeriod) {
  renderer_.gate_open = false;
  options_.grace = std::chrono::seconds(20);
  Running running(options_, &coordinator_, &renderer_);
  ASSERT_TRUE(Eventually([&] { return renderer_.rendering_count == 2; }));
  away_ = true;
  ASSERT_TRUE(Eventually([&] { return coordinator_.failures().size() == 2; }));  // Those queued.
  EXPECT_EQ(renderer_.rendering_count, 2);
  renderer_.gate_open = true;
  EXPECT_TRUE(Eventually([&] { return coordinator_.last_was_draining_and_empty(); }));
  EXPECT_EQ(coordinator_.done_count(), 2u);
  EXPECT_TRUE(running.Stop().ok());
}

TEST_F(AgentAwayTest, ReturnsTheRestFreesItsScenesAndComesBack) {
  renderer_.gate_open = false;
  Running running(options_, &coordinator_, &renderer_);
  ASSERT_TRUE(Eventually([&] { return renderer_.rendering_count == 2; }));
  EXPECT_TRUE(Eventually([&] { return scene_bytes_ > 0; }));
  away_ = true;
  EXPECT_TRUE(Eventually([&] { return coordinator_.last_was_draining_and_empty(); }));
  EXPECT_TRUE(Eventually([&] { return scene_bytes_ == 0; }));
  EXPECT_EQ(coordinator_.done_count(), 0u);
  for (const LeaseFailure& failure : coordinator_.failures()) {
    EXPECT_EQ(failure.kind, FailureKind::kReleased);
  }
  renderer_.gate_open = true;
  away_ = false;
  EXPECT_TRUE(Eventually([&] { return coordinator_.done_count() == 20; }));
  EXPECT_TRUE(running.Stop().ok());
  EXPECT_EQ(running.agent().counts().failed, 0u);
}

TEST_F(AgentAwayTest, StopsWhileItIsAway) {
  away_ = true;
  Running running(options_, &coordinator_, &renderer_);
  EXPECT_TRUE(Eventually([&] { return coordinator_.last_was_draining_and_empty(); }));
  EXPECT_TRUE(running.Stop().ok());
}

TEST_F(AgentAwayTest, TakesTurnsAsLongAsItLives) {
  Running running(options_, &coordinator_, &renderer_);
  ASSERT_TRUE(Eventually([&] { return coordinator_.done_count() == 20; }));
  EXPECT_TRUE(Eventually([&] { return running.agent().SinceLastTurn() < milliseconds(50); }));
  EXPECT_TRUE(running.Stop().ok());
  std::this_thread::sleep_for(milliseconds(60));
  EXPECT_GE(running.agent().SinceLastTurn(), milliseconds(60));
}

}  // namespace
}  // namespace sheaf::worker
