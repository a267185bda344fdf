// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/service/stop_signals.h"

#include <signal.h>
#include <time.h>

#include <chrono>
#include <utility>

#include "common/base/surroundings/ignored_signals.h"

namespace sheaf::worker {
namespace {

// timeout(1) and some supervisors signal a process and then its whole group: that counts as one
// stop request.
constexpr std::chrono::milliseconds kBurstDuration{300};
constexpr timespec kPollInterval{0, 100'000'000};  // Delay until the destructor is noticed.

sigset_t BlockOnlyStopSignals() {
  const sigset_t stop_signals = WithoutIgnored({SIGTERM, SIGINT, SIGHUP});
  // A write to a closed peer or pager, or of a file beyond ulimit -f, returns an error instead.
  ::signal(SIGPIPE, SIG_IGN);
  ::signal(SIGXFSZ, SIG_IGN);
  ::pthread_sigmask(SIG_SETMASK, &stop_signals, nullptr);
  return stop_signals;
}

}  // namespace

StopSignals::StopSignals(std::function<void(int signal_number, int count)> on_signal) {
  const sigset_t stop_signals = BlockOnlyStopSignals();
  thread_ = std::jthread([stop_signals, on_signal = std::move(on_signal)](std::stop_token ended) {
    int count = 0;
    std::chrono::steady_clock::time_point last;
    while (!ended.stop_requested()) {
      const int number = ::sigtimedwait(&stop_signals, nullptr, &kPollInterval);
      const auto now = std::chrono::steady_clock::now();
      if (number <= 0 || (count > 0 && now - last < kBurstDuration)) continue;
      last = now;
      on_signal(number, ++count);
    }
  });
}

}  // namespace sheaf::worker
