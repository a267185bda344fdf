// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Interruption: turns Ctrl-C and SIGTERM into a stop token. A second signal ends the program at
// once.
#pragma once

#include <stop_token>

#include "worker/service/stop_signals.h"

namespace sheaf::cli {

class Interruption {
 public:
  // Requires: no thread has been started yet.
  Interruption();
  std::stop_token token() const { return stop_.get_token(); }
  bool happened() const { return stop_.stop_requested(); }

 private:
  std::stop_source stop_;
  worker::StopSignals signals_;
};

}  // namespace sheaf::cli
