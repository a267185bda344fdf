// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobContinuation: continues jobs: refines those that succeeded, retries what failed, approves what
// waits for people, and renders images again.
#pragma once

#include <cstdint>
#include <optional>
#include <set>

#include "absl/status/status.h"
#include "coordinator/core/job/job_verbs.h"
#include "coordinator/service/farm/jobs/job_context.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class JobContinuation {
 public:
  explicit JobContinuation(JobContext& context) : context_(context) {}

  // Verbs (job_verbs.h), by name. OK means: the change is durable, or there was none to make.
  // Errors of all: kNotFound; kUnavailable, kResourceExhausted (the disk); those named here.
  //
  // Continues a job that succeeded, from its kept parts; missing parts are rendered again. A no-op
  // if all of its frames are good enough. Errors: kFailedPrecondition (it has not succeeded);
  // kInvalidArgument (fewer samples than it has).
  absl::Status RefineJob(uint64_t job_id, const JobArguments& arguments);
  // Continues frames that wait for approval: these or, if none is named, all that wait now. A no-op
  // for approved frames. Requires: no result is taken meanwhile. Errors: kFailedPrecondition (the
  // job or a frame does not wait).
  absl::Status ApproveFrames(uint64_t job_id, const JobArguments& arguments);
  // Clears the failures of a job, of a frame of it or of a task, and leases tasks again that were
  // set aside; a failed job continues. Requires: no result is taken meanwhile. Errors:
  // kFailedPrecondition (it has ended otherwise); kResourceExhausted (the owner's limits).
  absl::Status RetryTasks(uint64_t job_id, const JobArguments& arguments);

  // Renders delivered frames again, from their kept parts. A no-op for a job that has not
  // succeeded: it is being refined.
  absl::Status RemakeFrames(uint64_t job_id, const std::set<int32_t>& numbers);

 private:
  absl::Status CheckRefinement(const JobRecord& job, const Refinement& refinement) const;
  // Makes a frame whose parts were removed continue from its delivered image, if it can.
  void ContinueFromImage(const JobSpec& job, JobStore::ReopenedFrame* frame) const;
  // Reopens the job's frames that ended without an image.
  absl::Status ReopenUndelivered(uint64_t job_id, std::optional<int32_t> frame,
                                 std::optional<uint32_t> task)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(context_.settle_mutex);

  JobContext& context_;
};

// Errors: kFailedPrecondition if the job has ended without success.
absl::Status RequireNotGivenUp(const JobRecord& job);
// Errors: kFailedPrecondition unless the job has succeeded.
absl::Status RequireSucceeded(const JobRecord& job);

}  // namespace sheaf::coordinator
