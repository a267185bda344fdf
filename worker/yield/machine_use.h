// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MachineUse: how much of this machine other programs use. Workers render at a lower priority (nice
// above 0), and Linux counts the processor time of such programs apart: so the time at ordinary
// priority is that of other programs, however many workers there are.
// Source: proc(5): the columns "user" and "nice" of /proc/stat, MemAvailable of /proc/meminfo.
#pragma once

#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <utility>

#include "absl/time/time.h"
#include "common/base/steady_time.h"

namespace sheaf::worker {

// Unknown fields are absent.
struct MachineReading {
  std::optional<double> processor_seconds;   // Since boot, at ordinary priority.
  std::optional<uint64_t> memory_available;  // In bytes.
};

// proc: "/proc"; tests pass another folder.
MachineReading ReadMachine(const std::string& proc = "/proc");

// Processors in use, as a mean over a window, from counted processor time.
class ProcessorUse {
 public:
  explicit ProcessorUse(absl::Duration window) : window_(window) {}

  // Adds a reading, in order of time. Returns the mean over the window; none before the window has
  // passed once.
  std::optional<double> Add(SteadyTime now, double processor_seconds);

 private:
  const absl::Duration window_;
  std::deque<std::pair<SteadyTime, double>> readings_;  // The first one is a window old, or more.
};

}  // namespace sheaf::worker
