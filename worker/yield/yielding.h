// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Yielding: decides when a worker takes no work because its machine has a user. Pure decisions:
// time and readings are arguments.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "absl/time/civil_time.h"
#include "absl/time/time.h"
#include "common/base/steady_time.h"
#include "worker/yield/hours.h"
#include "worker/yield/machine_use.h"

namespace sheaf::worker {

struct YieldOptions {
  WorkingHours hours;
  // Processors that other programs may use, as a mean over load_window; none: any number.
  std::optional<double> processors_max;
  // Memory that must be available to other programs; 0: none.
  uint64_t memory_available_min = 0;
  absl::Duration load_window = absl::Seconds(10);
  // It comes back when there was no reason for so long. Hours end at once.
  absl::Duration calm = absl::Minutes(2);
};

class Yielding {
 public:
  explicit Yielding(const YieldOptions& options)
      : options_(options), processor_use_(options.load_window) {}

  // Returns why the worker must take no work now, for users; empty: it may. Call about every
  // second, in order of time. local: the clock on the wall. scene_bytes: memory of the scenes that
  // this worker has loaded; a worker that went away for lack of memory comes back when there is
  // room for as much as it had, too.
  std::string WhyAway(SteadyTime now, absl::CivilMinute local, const MachineReading& reading,
                      uint64_t scene_bytes);

 private:
  std::string Reason(SteadyTime now, const MachineReading& reading, uint64_t scene_bytes);

  const YieldOptions options_;
  ProcessorUse processor_use_;
  uint64_t bytes_to_come_back_ = 0;  // That it had when it went away.
  std::string away_;                 // The reason for which it went away last; empty: it is back.
  SteadyTime last_reason_;
};

}  // namespace sheaf::worker
