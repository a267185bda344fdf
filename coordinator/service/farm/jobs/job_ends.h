// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobEnds: advances the time of jobs, and stores what becomes of them: failures, warnings and,
// after those, ends.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "coordinator/service/farm/jobs/job_context.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class JobEnds {
 public:
  explicit JobEnds(JobContext& context) : context_(context) {}

  // Advances time: marks workers as lost, expires leases, and cancels unrequested pilots. Returns
  // whether anything changed that a FarmView shows.
  bool Tick();
  // Stores the ends of jobs and their failures, and removes their parts. Concurrent calls wait
  // until that is durable. The next call retries writes that the disk refused.
  void SettleEnded() ABSL_LOCKS_EXCLUDED(context_.settle_mutex);
  // Stores new failures and quarantines. The next call retries writes that the disk refused.
  void SaveFailures() ABSL_LOCKS_EXCLUDED(context_.settle_mutex);
  // Adds the delivery to the job's events.
  void NoteDelivered(const FrameId& id, const DeliveredFrame& delivered);
  // Replaces the job's warning about its images. Errors: those of the store.
  absl::Status SetWarning(uint64_t job_id, const std::string& text);
  // Removes parts of delivered frames, the oldest first, while there are more than the limit.
  void LimitKeptParts() ABSL_LOCKS_EXCLUDED(context_.settle_mutex);

 private:
  JobContext& context_;
};

// Stores new failures of tasks. Errors: those of the store; the next call tries again.
absl::Status SaveNewTroubles(JobContext& context)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.settle_mutex);
// The same for quarantines. OK: none is only in memory.
absl::Status SaveNewQuarantines(JobContext& context)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.settle_mutex);

}  // namespace sheaf::coordinator
