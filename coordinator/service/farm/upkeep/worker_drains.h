// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WorkerDrains: workers drained by operators (docs/scheduling.md). A drained worker finishes its
// leases and gets no further ones until it is undrained. A drain names one run of a worker program:
// it is durable, because workers outlive the coordinator, and it is removed when the worker has
// ended or does not return.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/base/steady_time.h"
#include "coordinator/core/job/limits.h"
#include "coordinator/service/farm/state/disk_state.h"
#include "coordinator/service/farm/state/farm_signals.h"
#include "coordinator/service/farm/state/farm_tables.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// Workers by name, and all connected workers of a host; host empty: none.
struct ChosenWorkers {
  std::vector<std::string> worker_ids;
  std::string host;
};

// Thread safety: all members may be called concurrently.
class WorkerDrains {
 public:
  // The objects that it works on; all must outlive it.
  struct Parts {
    FarmTables& tables;
    JobStore& store;
    DiskState& disk;
    FarmSignals& signals;
  };
  WorkerDrains(const Limits& limits, const Parts& parts)
      : limits_(limits),
        tables_(parts.tables),
        store_(parts.store),
        disk_(parts.disk),
        signals_(parts.signals) {}

  // Restores the stored drains. Call once, first. Errors: those of the store.
  absl::Status Load() ABSL_LOCKS_EXCLUDED(mutex_);

  // Both return the workers, ascending. OK means: it is durable. Errors: kInvalidArgument (none is
  // named); kNotFound (no such worker); kResourceExhausted (too many are drained, or the disk is
  // full); kUnavailable (the disk).
  absl::StatusOr<std::vector<std::string>> Drain(const ChosenWorkers& chosen, bool then_exit)
      ABSL_LOCKS_EXCLUDED(mutex_);
  absl::StatusOr<std::vector<std::string>> Undrain(const ChosenWorkers& chosen)
      ABSL_LOCKS_EXCLUDED(mutex_);

  // Removes the drains of workers that have ended, and of workers silent for
  // Limits::lost_worker_kept. Runs at most once a minute.
  void ForgetOld() ABSL_LOCKS_EXCLUDED(mutex_);

 private:
  struct Entry {
    bool then_exit = false;
    SteadyTime known_time;  // When the worker was last known, or the drain was made.
  };
  absl::StatusOr<std::vector<std::string>> Choose(const ChosenWorkers& chosen) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const Limits limits_;
  FarmTables& tables_;
  JobStore& store_;
  DiskState& disk_;
  FarmSignals& signals_;
  mutable Mutex mutex_;  // Also held while the disk writes. Taken before the tables' mutex.
  std::map<std::string, Entry> drains_ ABSL_GUARDED_BY(mutex_);
  SteadyTime next_look_ ABSL_GUARDED_BY(mutex_) = SteadyTime::InfinitePast();
};

}  // namespace sheaf::coordinator
