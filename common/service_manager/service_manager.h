// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ServiceManager: tells the service manager that started this program how it fares, by systemd's
// protocol for services of Type=notify: datagrams of lines NAME=VALUE to the socket that
// NOTIFY_SOCKET names. Without that variable nothing is sent, so that programs need not ask.
// Source: sd_notify(3) and sd_watchdog_enabled(3) of systemd 252.
#pragma once

#include <string>

#include "absl/time/time.h"

namespace sheaf {

// Thread safety: all members may be called from any thread.
class ServiceManager {
 public:
  // Reads NOTIFY_SOCKET, WATCHDOG_USEC and WATCHDOG_PID, and removes them from the environment, so
  // that processes which this one starts do not speak in its name. Call before any other thread
  // exists.
  ServiceManager();
  ~ServiceManager();
  ServiceManager(const ServiceManager&) = delete;
  ServiceManager& operator=(const ServiceManager&) = delete;

  // Whether a service manager listens.
  bool listens() const { return socket_ >= 0; }
  // The program is restarted if it does not call KeepAlive for this long; zero: no watchdog.
  absl::Duration watchdog_timeout() const { return watchdog_timeout_; }

  // The program has started. status: one line of text, shown by "systemctl status".
  void Ready(const std::string& status) const;
  void Status(const std::string& status) const;
  // It ends, as it was told.
  void Stopping() const;
  // Reports that the program is healthy.
  void KeepAlive() const;

 private:
  // A message that does not arrive is dropped: no program waits for its manager.
  void Send(const std::string& lines) const;

  int socket_ = -1;
  absl::Duration watchdog_timeout_ = absl::ZeroDuration();
};

}  // namespace sheaf
