// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Signals that were ignored at the start: nohup(1) does so with SIGHUP, and shells with SIGINT for
// what scripts start in the background. They stay ignored.
#pragma once

#include <signal.h>

#include <initializer_list>

namespace sheaf {

// The given signals except ignored ones, to be blocked and waited for. Linux keeps a blocked signal
// pending even if it is ignored, so that sigwait(3) would return it.
inline sigset_t WithoutIgnored(std::initializer_list<int> numbers) {
  sigset_t signals;
  sigemptyset(&signals);
  for (const int number : numbers) {
    struct sigaction action {};
    const bool is_ignored = ::sigaction(number, nullptr, &action) == 0 &&
                            (action.sa_flags & SA_SIGINFO) == 0 && action.sa_handler == SIG_IGN;
    if (!is_ignored) sigaddset(&signals, number);
  }
  return signals;
}

}  // namespace sheaf
