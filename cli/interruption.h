// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Interruption: turns Ctrl-C and SIGTERM into a stop token. The first signal always ends the
// program within a short time, a second one at once.
#pragma once

#include <atomic>
#include <chrono>
#include <stop_token>
#include <thread>

#include "worker/service/stop_signals.h"

namespace sheaf::cli {

// How long a command may take to end after a signal, to keep finished work. The compilation of a
// scene cannot be stopped.
inline constexpr std::chrono::seconds kInterruptionGrace{10};

class Interruption {
 public:
  // Requires: no thread has been started yet.
  explicit Interruption(std::chrono::milliseconds grace = kInterruptionGrace);
  ~Interruption();  // Later signals end the program, as they do without an Interruption.
  Interruption(const Interruption&) = delete;
  Interruption& operator=(const Interruption&) = delete;

  // A caller that takes the token must end soon after a signal. Until it is taken, while scenes are
  // read and there is no work to keep, a signal ends the program at once.
  std::stop_token token() const;

 private:
  void OnSignal(int count);

  const std::chrono::milliseconds grace_;
  std::stop_source stop_;
  mutable std::atomic<bool> is_heeded_ = false;
  std::jthread deadline_;  // From the first signal on.
  worker::StopSignals signals_;
};

}  // namespace sheaf::cli
