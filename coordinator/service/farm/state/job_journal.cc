// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/state/job_journal.h"

#include <utility>

#include "absl/time/clock.h"

namespace sheaf::coordinator {

void JobJournal::Note(JobEvent event) {
  event.time = absl::Now();
  const MutexLock lock(&mutex_);
  if (waiting_.size() < kEventsWaitingMax) waiting_.push_back(std::move(event));
}

void JobJournal::Write() {
  const MutexLock writing(&write_mutex_);
  std::vector<JobEvent> events;
  {
    const MutexLock lock(&mutex_);
    events = waiting_;
  }
  if (events.empty() || !store_.AppendEvents(events).ok()) return;
  const MutexLock lock(&mutex_);
  waiting_.erase(waiting_.begin(), waiting_.begin() + static_cast<std::ptrdiff_t>(events.size()));
}

absl::StatusOr<std::vector<JobEvent>> JobJournal::Read(uint64_t job_id) {
  const MutexLock writing(&write_mutex_);
  absl::StatusOr<std::vector<JobEvent>> events = store_.LoadEvents(job_id);
  if (!events.ok()) return events;
  const MutexLock lock(&mutex_);
  for (const JobEvent& event : waiting_) {
    if (event.job_id == job_id) events->push_back(event);
  }
  return events;
}

}  // namespace sheaf::coordinator
