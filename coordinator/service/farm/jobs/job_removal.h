// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobRemoval: removes stored data of ended jobs. A removal is durable before its files are removed.
#pragma once

#include <cstdint>
#include <functional>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "coordinator/core/job/job_verbs.h"
#include "coordinator/service/farm/jobs/job_context.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class JobRemoval {
 public:
  explicit JobRemoval(JobContext& context) : context_(context) {}

  // A verb (job_verbs.h). Removes a job that has ended, with its images, even if it has only just
  // ended. Errors: kNotFound; kFailedPrecondition (it has not ended, is pinned, or another job
  // waits for it); kUnavailable, kResourceExhausted (the disk).
  absl::Status DeleteJob(uint64_t job_id, const JobArguments& arguments);

  // Each removes stored data of an unpinned job whose end is durable. Errors: kNotFound;
  // kFailedPrecondition (not such a job); those of the store. After an error RemoveParts may have
  // removed some parts; call it again for the rest.
  absl::Status RemoveParts(uint64_t job_id, absl::Time now);
  absl::Status RemovePreviews(uint64_t job_id);  // Also for a removed job.
  absl::Status RemoveJob(uint64_t job_id);  // kFailedPrecondition also if it has only just ended.

  // How often ended jobs were reopened since the coordinator started.
  uint64_t ReopenCount() ABSL_LOCKS_EXCLUDED(context_.settle_mutex);
  // Calls `act` while no job can be reopened, if none was since ReopenCount was `seen`. Returns
  // whether it did.
  bool IfNoneReopened(uint64_t seen, const std::function<void()>& act)
      ABSL_LOCKS_EXCLUDED(context_.settle_mutex);

 private:
  absl::Status RequireUnused(uint64_t job_id) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(context_.tables.mutex);
  absl::Status RemoveUnused(uint64_t job_id) ABSL_EXCLUSIVE_LOCKS_REQUIRED(context_.settle_mutex);

  JobContext& context_;
};

}  // namespace sheaf::coordinator
