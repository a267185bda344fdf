// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Runs simulations in child processes, so that one that crashes or hangs is a failed seed and not
// the end; and shortens those that fail.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tests/sim/simulation.h"

namespace sheaf::sim {

struct FailedSeed {
  uint64_t seed = 0;
  std::string broken;
};
struct Totals {
  uint64_t seed_count = 0, step_count = 0;
  uint64_t jobs_succeeded = 0, jobs_failed = 0, jobs_cancelled = 0, lives = 0;
  uint64_t liars_found = 0, false_images = 0;
  std::array<uint64_t, kFaultCount> faults{};
  double cpu_seconds = 0;          // The sum over all processes.
  std::vector<FailedSeed> failed;  // At most kFailedSeedsMax: then the run ends.
};
inline constexpr size_t kFailedSeedsMax = 32;

// Runs the seeds from `first` to `last`, in `process_count` processes at a time. failed_max: how
// many may fail before the run ends early, at most kFailedSeedsMax.
Totals RunSeeds(uint64_t first, uint64_t last, int process_count, size_t failed_max,
                const SimulationOptions& options);

// Runs one simulation in a process of its own. Returns what it printed, and what is broken.
struct IsolatedRun {
  std::string broken;  // Empty: all is right.
  std::string output;
};
IsolatedRun RunIsolated(const SimulationOptions& options);

// Looks for a shorter run that fails as well: with fewer kinds of faults and fewer steps.
SimulationOptions Shorten(SimulationOptions options);

}  // namespace sheaf::sim
