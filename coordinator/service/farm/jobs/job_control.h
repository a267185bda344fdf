// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobControl: creates, pauses, resumes, prioritizes, releases, pins and cancels jobs. A change is
// durable before it is acknowledged.
#pragma once

#include <cstdint>
#include <string>

#include "absl/status/statusor.h"
#include "coordinator/core/job/job_verbs.h"
#include "coordinator/service/farm/jobs/job_context.h"
#include "coordinator/service/farm/jobs/job_ends.h"

namespace sheaf::coordinator {

// Thread safety: all members may be called concurrently.
class JobControl {
 public:
  JobControl(JobContext& context, JobEnds& ends) : context_(context), ends_(ends) {}

  // Stores and starts a job; job_id, numeric_profile and frame digests are filled in here. Returns
  // the id, or that of an earlier job with an equal request_id. Errors: those of
  // Scheduler::CheckJob; kInvalidArgument (a frame cannot resume its image); kResourceExhausted
  // (disk).
  absl::StatusOr<uint64_t> Create(JobSpec spec, const std::string& request_id);

  // Verbs (job_verbs.h), by name. OK means: the change is durable, or there was none to make.
  // Errors of all: kNotFound; kUnavailable, kResourceExhausted (the disk); those named here.
  //
  // A no-op if the job was cancelled. Errors: kFailedPrecondition (it has ended otherwise).
  absl::Status CancelJob(uint64_t job_id, const JobArguments& arguments);
  // A paused job gets no new leases until it is resumed. Errors: kFailedPrecondition (it has
  // ended).
  absl::Status PauseJob(uint64_t job_id, const JobArguments& arguments);
  absl::Status ResumeJob(uint64_t job_id, const JobArguments& arguments);
  // Errors: kInvalidArgument; kFailedPrecondition (it has ended).
  absl::Status SetJobPriority(uint64_t job_id, const JobArguments& arguments);
  // Releases a job from its dependencies, whatever their state. Errors: kFailedPrecondition (it
  // waits for none, or has ended).
  absl::Status ReleaseJob(uint64_t job_id, const JobArguments& arguments);
  // Sets a task, or a whole frame, aside until it is retried. Errors: kInvalidArgument (no frame);
  // kFailedPrecondition (it has ended, or the task is rendered).
  absl::Status KillTasks(uint64_t job_id, const JobArguments& arguments);
  // A pinned job keeps all its stored data until it is unpinned.
  absl::Status PinJob(uint64_t job_id, const JobArguments& arguments);
  absl::Status UnpinJob(uint64_t job_id, const JobArguments& arguments);

  // Records that a client waits for the pilot; otherwise it is cancelled
  // (Limits::pilot_unasked_max).
  void NotePilotRequest(uint64_t job_id);
  // Ends the quarantine of an identity; a no-op if it is not in quarantine. OK means: it is
  // durable. Errors: kFailedPrecondition (its false results are still being removed); kUnavailable,
  // kResourceExhausted (the disk).
  absl::Status LiftQuarantine(const std::string& identity);

 private:
  // Requires: no job that the new one waits for is removed meanwhile.
  absl::StatusOr<uint64_t> CreateNew(JobSpec spec, const std::string& request_id);
  absl::Status SetPaused(uint64_t job_id, bool paused);
  absl::Status SetPinned(uint64_t job_id, bool pinned);

  JobContext& context_;
  JobEnds& ends_;
};

}  // namespace sheaf::coordinator
