// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/service_manager/watchdog.h"

#include <utility>

#include "common/base/mutex.h"

namespace sheaf {

Watchdog::Watchdog(const ServiceManager* manager, std::function<bool()> lives) {
  if (manager->watchdog_timeout() <= absl::ZeroDuration()) return;
  thread_ = std::jthread([manager, lives = std::move(lives)](const std::stop_token& ended) {
    while (!ended.stop_requested()) {
      if (lives()) manager->KeepAlive();
      SleepUnlessStopped(manager->watchdog_timeout() / 2, ended);
    }
  });
}

}  // namespace sheaf
