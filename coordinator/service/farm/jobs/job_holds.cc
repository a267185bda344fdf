// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of JobLifecycle that continues held work: it releases jobs that wait for others, and
// approves frames (docs/scheduling.md).
#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "coordinator/core/job/job_approval.h"
#include "coordinator/service/farm/jobs/job_lifecycle.h"

namespace sheaf::coordinator {
namespace {

// Errors: kFailedPrecondition if the job has ended without success.
absl::Status RequireNotGivenUp(const JobRecord& job) {
  if (job.phase == JobPhase::kLive || job.phase == JobPhase::kSucceeded) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      "jobs/", job.spec.job_id, job.phase == JobPhase::kFailed ? " has failed" : " was cancelled",
      job.phase == JobPhase::kFailed ? "; retry it first, by sheaf retry" : ""));
}

bool IsDelivered(const JobRecord& job, int32_t number) {
  const std::optional<uint32_t> index = job.FindIndex(number);
  return index && job.frames[*index].phase == FrameRecord::Phase::kDelivered;
}

// Those of the named frames, or of all frames, that wait for approval. Errors: kNotFound;
// kFailedPrecondition (a named one does not wait, and is not approved).
absl::StatusOr<std::set<int32_t>> ChooseWaiting(const JobRecord& job,
                                                const std::vector<int32_t>& numbers) {
  const std::string name = absl::StrCat("jobs/", job.spec.job_id);
  std::set<int32_t> waiting;
  if (job.spec.approvals.empty()) {
    return absl::FailedPreconditionError(absl::StrCat(
        name, " does not wait for approval: it was submitted without ", "--approve-after"));
  }
  for (const auto& [number, approval] : job.spec.approvals) {
    if (!approval.approved && IsDelivered(job, number)) waiting.insert(number);
  }
  if (numbers.empty()) return waiting;
  std::set<int32_t> chosen;
  for (const int32_t number : numbers) {
    if (!job.FindIndex(number)) {
      return absl::NotFoundError(absl::StrCat(name, " has no frame ", number));
    }
    if (!IsUnapproved(job.spec, number)) continue;
    if (!waiting.contains(number)) {
      return absl::FailedPreconditionError(
          absl::StrCat(name, ": frame ", number,
                       " does not have its first samples yet; approve "
                       "it ",
                       "when there is an image to look at"));
    }
    chosen.insert(number);
  }
  return chosen;
}

}  // namespace

absl::Status JobLifecycle::ReleaseJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  const MutexLock settling(&settle_mutex_);  // No end or new beginning is written meanwhile.
  {
    const MutexLock lock(&tables_.mutex);
    const absl::StatusOr<const JobRecord*> job = tables_.FindJob(job_id);
    if (!job.ok()) return job.status();
    if ((*job)->spec.dependencies.empty()) {
      return absl::FailedPreconditionError(absl::StrCat(
          "jobs/", job_id, " waits for no other job; sheaf resume ends a pause, sheaf approve ",
          "a wait for approval"));
    }
    if (absl::Status there = RequireNotGivenUp(**job); !there.ok()) return there;
  }
  // Written even if nothing changes, as in SetPaused.
  absl::Status written = store_.ReleaseJob(job_id);
  disk_.Note(written);
  if (!written.ok()) return written;
  {
    const MutexLock lock(&tables_.mutex);
    tables_.scheduler.Release(job_id);
  }
  LogInfo(absl::StrCat("job ", job_id, " is released: it waits for no other job"));
  signals_.Changed();
  return absl::OkStatus();
}

absl::Status JobLifecycle::ApproveFrames(uint64_t job_id, const JobArguments& arguments) {
  const MutexLock settling(&settle_mutex_);
  StoredJob job;
  std::set<int32_t> chosen;
  {
    const MutexLock lock(&tables_.mutex);
    const absl::StatusOr<const JobRecord*> found = tables_.FindJob(job_id);
    if (!found.ok()) return found.status();
    if (absl::Status there = RequireNotGivenUp(**found); !there.ok()) return there;
    absl::StatusOr<std::set<int32_t>> waiting = ChooseWaiting(**found, arguments.frames);
    if (!waiting.ok()) return waiting.status();
    chosen = *std::move(waiting);
    job = StoredJobOf(**found);
  }
  if (chosen.empty()) return absl::OkStatus();  // An earlier call has done it.
  absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> rounds = RoundsOf(job_id);
  if (!rounds.ok()) return rounds.status();
  std::vector<JobStore::ReopenedFrame> reopened;
  for (FrameSpec& frame : job.spec.frames) {
    if (!chosen.contains(frame.frame_number)) continue;
    FrameApproval& approval = job.spec.approvals.at(frame.frame_number);
    approval.approved = true;
    frame.settings.samples = approval.samples;
    reopened.push_back({frame, std::move((*rounds)[frame.frame_number])});
  }
  if (absl::Status status = ReopenFrames(std::move(job), reopened); !status.ok()) return status;
  LogInfo(absl::StrCat("job ", job_id, ": ", chosen.size(),
                       chosen.size() == 1 ? " frame is" : " frames are", " approved"));
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
