// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobJournal: the events of jobs. They are noted in memory, under any lock, and written by the
// background thread, so that no lease and no result waits for them; kill -9 loses those of the last
// moment.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "coordinator/core/job/job_event.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// Events that wait for the disk; further ones are dropped.
inline constexpr size_t kEventsWaitingMax = 10'000;

// Thread safety: all members may be called concurrently.
class JobJournal {
 public:
  // The store must outlive the object.
  explicit JobJournal(JobStore* store) : store_(*store) {}

  // Sets the event's time.
  void Note(JobEvent event) ABSL_LOCKS_EXCLUDED(mutex_);
  // Writes what waits. After an error it still waits; events are no reason to stop work.
  void Write() ABSL_LOCKS_EXCLUDED(write_mutex_, mutex_);
  // The job's events, including those that wait. Errors: those of the store.
  absl::StatusOr<std::vector<JobEvent>> Read(uint64_t job_id)
      ABSL_LOCKS_EXCLUDED(write_mutex_, mutex_);

 private:
  JobStore& store_;
  Mutex write_mutex_;  // Held by one write or read at a time. Taken before mutex_.
  Mutex mutex_;
  std::vector<JobEvent> waiting_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::coordinator
