// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// StopSignals: delivers SIGTERM, SIGINT and SIGHUP as calls on an ordinary thread, free of the
// restrictions on signal handlers.
#pragma once

#include <functional>
#include <thread>

namespace sheaf::worker {

class StopSignals {
 public:
  // Calls on_signal with the signal's number and the count of signals so far, from 1; signals
  // within a fraction of a second of another count as the same. Create it before any other thread:
  // threads inherit the blocked signals. Unblocks all others, which a batch system may have
  // blocked for its children (Slurm blocks SIGTERM). Signals that are ignored stay so.
  explicit StopSignals(std::function<void(int signal_number, int count)> on_signal);
  ~StopSignals() = default;  // Ends the thread; later signals stay pending.

 private:
  std::jthread thread_;
};

}  // namespace sheaf::worker
