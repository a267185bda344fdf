// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/light_pass_gate.h"

#include <gtest/gtest.h>

#include <atomic>
#include <optional>
#include <thread>
#include <vector>

namespace sheaf::worker {
namespace {

TEST(LightPassGateTest, PassesThatFitEnterTogether) {
  LightPassGate gate(100);
  const auto first = gate.Enter(40, {}), second = gate.Enter(60, {});
  EXPECT_TRUE(first.ok());
  EXPECT_TRUE(second.ok());
}

TEST(LightPassGateTest, OneThatIsTooLargeEntersAlone) {
  LightPassGate gate(100);
  EXPECT_TRUE(gate.Enter(1'000, {}).ok());
  EXPECT_TRUE(gate.Enter(UINT64_MAX, {}).ok()) << "the first has left";
}

TEST(LightPassGateTest, OthersWaitUntilThereIsRoom) {
  LightPassGate gate(100);
  std::atomic<int> inside{0}, most{0}, entered{0};
  std::vector<std::jthread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] {
      for (int turn = 0; turn < 50; ++turn) {
        const auto pass = gate.Enter(40, {});
        ASSERT_TRUE(pass.ok());
        const int now = ++inside;
        for (int seen = most; seen < now && !most.compare_exchange_weak(seen, now);) {
        }
        ++entered;
        std::this_thread::yield();
        --inside;
      }
    });
  }
  threads.clear();
  EXPECT_EQ(entered, 400);
  EXPECT_LE(most, 2);
}

TEST(LightPassGateTest, WaitingEndsWhenStopped) {
  LightPassGate gate(100);
  std::optional first = gate.Enter(100, {});
  std::stop_source stop;
  std::jthread stopper([&] { stop.request_stop(); });
  EXPECT_TRUE(absl::IsCancelled(gate.Enter(1, stop.get_token()).status()));
  first.reset();
  EXPECT_TRUE(gate.Enter(1, {}).ok());
}

}  // namespace
}  // namespace sheaf::worker
