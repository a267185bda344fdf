// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/stop_signals.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <thread>

namespace sheaf::worker {
namespace {

TEST(StopSignalsTest, HandlesSignalsBlockedByItsParent) {
  sigset_t all;
  sigfillset(&all);
  ::pthread_sigmask(SIG_SETMASK, &all, nullptr);
  std::atomic<int> last{0}, times{0};
  const StopSignals signals([&](int number, int count) {
    last = number;
    times = count;
  });
  sigset_t now;
  ::pthread_sigmask(SIG_SETMASK, nullptr, &now);
  EXPECT_EQ(sigismember(&now, SIGUSR1), 0);
  const auto wait_for = [&](int count) {
    for (int i = 0; i < 2000 && times < count; ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
  };
  ::kill(::getpid(), SIGTERM);
  wait_for(1);
  EXPECT_EQ(last, SIGTERM);
  ::kill(::getpid(), SIGTERM);  // Immediately after the first: the same request.
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  EXPECT_EQ(times, 1);
  ::kill(::getpid(), SIGINT);
  wait_for(2);
  EXPECT_EQ(last, SIGINT);
  EXPECT_EQ(times, 2);
}

// In a process of its own: the handlers and masks of this one are the other tests'.
void DeliverWhereHangupsAreIgnored(int number) {
  ::signal(SIGHUP, SIG_IGN);
  ::signal(SIGINT, SIG_IGN);
  std::atomic<int> last{0};
  const StopSignals signals([&](int received, int) { last = received; });
  ::kill(::getpid(), SIGHUP);
  ::kill(::getpid(), SIGINT);
  ::kill(::getpid(), number);
  for (int i = 0; i < 2000 && last == 0; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(5));
  }
  std::exit(last);
}

TEST(StopSignalsDeathTest, IgnoredSignalsStayIgnored) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  EXPECT_EXIT(DeliverWhereHangupsAreIgnored(SIGTERM), testing::ExitedWithCode(SIGTERM), "");
}

}  // namespace
}  // namespace sheaf::worker
