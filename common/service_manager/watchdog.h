// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Watchdog: tells the service manager twice per timeout that the program is healthy, if it is.
#pragma once

#include <functional>
#include <thread>

#include "common/service_manager/service_manager.h"

namespace sheaf {

class Watchdog {
 public:
  // lives: called on a thread of its own, at once and then twice per timeout. If it returns false,
  // or does not return, no message is sent, and the manager restarts the program. A no-op without a
  // watchdog. Requires: manager outlives this.
  Watchdog(const ServiceManager* manager, std::function<bool()> lives);
  ~Watchdog() = default;  // Waits for lives to return.

 private:
  std::jthread thread_;
};

}  // namespace sheaf
