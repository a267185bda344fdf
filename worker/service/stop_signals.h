// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// StopSignals: SIGTERM, SIGINT and SIGHUP as calls on an ordinary thread, where everything is
// allowed.
#pragma once

#include <functional>
#include <thread>

namespace sheaf::worker {

class StopSignals {
 public:
  // Calls on_signal with the signal's number and how many have come, from 1 on; signals that follow
  // another within a fraction of a second count as the same. Make it before any
  // other thread begins: they inherit that these signals are blocked. Everything else that a batch
  // system may have blocked or ignored for its children (Slurm blocks SIGTERM) is reset.
  explicit StopSignals(std::function<void(int signal_number, int count)> on_signal);
  ~StopSignals() = default;  // Ends the thread; later signals stay pending.

 private:
  std::jthread thread_;
};

}  // namespace sheaf::worker
