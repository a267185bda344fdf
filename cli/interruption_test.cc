// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/interruption.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <cstdlib>

#include "cli/exit_code.h"

namespace sheaf::cli {
namespace {

constexpr int kInterruptedCode = static_cast<int>(ExitCode::kInterrupted);

// The cases run in processes of their own: masks and handlers of this one are the other tests'.
class InterruptionDeathTest : public ::testing::Test {
 protected:
  InterruptionDeathTest() { GTEST_FLAG_SET(death_test_style, "threadsafe"); }
  [[noreturn]] static void WaitForTheEnd() {
    while (true) ::pause();
  }
};

TEST_F(InterruptionDeathTest, TheFirstSignalEndsACommandThatPreparesItsScene) {
  const auto prepare = [] {
    const Interruption interruption(std::chrono::hours(1));
    ::kill(::getpid(), SIGTERM);
    WaitForTheEnd();
  };
  EXPECT_EXIT(prepare(), ::testing::ExitedWithCode(kInterruptedCode), "sheaf: interrupted\n");
}

TEST_F(InterruptionDeathTest, TheFirstSignalEndsACommandThatCannotStop) {
  const auto compile = [] {
    const Interruption interruption(std::chrono::milliseconds(1));
    const std::stop_token token = interruption.token();
    ::kill(::getpid(), SIGTERM);
    WaitForTheEnd();
  };
  EXPECT_EXIT(compile(), ::testing::ExitedWithCode(kInterruptedCode), "did not end in time");
}

TEST_F(InterruptionDeathTest, ACommandThatHeedsTheTokenKeepsWhatIsDone) {
  const auto heed = [] {
    {
      const Interruption interruption(std::chrono::hours(1));
      const std::stop_token token = interruption.token();
      ::kill(::getpid(), SIGTERM);
      while (!token.stop_requested()) ::usleep(1000);
    }
    std::exit(7);
  };
  EXPECT_EXIT(heed(), ::testing::ExitedWithCode(7), "");
}

TEST_F(InterruptionDeathTest, AfterwardsSignalsEndTheProgram) {
  const auto go_on = [] {
    { const Interruption interruption; }
    ::kill(::getpid(), SIGTERM);
    WaitForTheEnd();
  };
  EXPECT_EXIT(go_on(), ::testing::KilledBySignal(SIGTERM), "");
}

}  // namespace
}  // namespace sheaf::cli
