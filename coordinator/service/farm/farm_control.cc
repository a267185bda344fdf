// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Farm that does what people want of a job: wait, go on, go before others, or end.
#include <algorithm>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "coordinator/service/farm/farm.h"

namespace sheaf::coordinator {
namespace {

// Errors: kFailedPrecondition, naming the job's state, where it has ended.
absl::Status RequireUnfinished(const JobRecord& job, const char* action) {
  if (job.phase == JobPhase::kLive) return absl::OkStatus();
  const char* const state = job.phase == JobPhase::kSucceeded ? "has succeeded"
                            : job.phase == JobPhase::kFailed  ? "has failed"
                                                              : "was cancelled";
  return absl::FailedPreconditionError(
      absl::StrCat("jobs/", job.spec.job_id, " ", state, "; only an unfinished job can ", action));
}

}  // namespace

absl::StatusOr<const JobRecord*> Farm::FindRecord(uint64_t job_id) const {
  const auto found = scheduler_.jobs().find(job_id);
  if (found != scheduler_.jobs().end()) return &found->second;
  return absl::NotFoundError(absl::StrCat("jobs/", job_id, ": there is no such job"));
}

void Farm::NoteAsked(uint64_t job_id) {
  const MutexLock lock(&mutex_);
  const auto pilot = pilots_asked_.find(job_id);
  if (pilot != pilots_asked_.end()) pilot->second = std::chrono::steady_clock::now();
}

void Farm::CancelForgottenPilots() {
  const auto now = std::chrono::steady_clock::now();
  std::vector<uint64_t> forgotten;
  for (const auto& [id, asked] : pilots_asked_) {
    if (absl::FromChrono(now - asked) > options_.limits.pilot_unasked_max) forgotten.push_back(id);
  }
  for (const uint64_t id : forgotten) {
    LogInfo(absl::StrCat("job ", id, ": no client waits for this pilot"));
    scheduler_.EndJob(id, JobPhase::kCancelled, "");
  }
}

absl::Status Farm::CancelJob(uint64_t job_id) {
  {
    const MutexLock lock(&mutex_);
    const absl::StatusOr<const JobRecord*> job = FindRecord(job_id);
    if (!job.ok()) return job.status();
    if ((*job)->phase != JobPhase::kCancelled) {  // A second call waits for the first.
      absl::Status live = RequireUnfinished(**job, "be cancelled");
      if (!live.ok()) return live;
    }
    scheduler_.EndJob(job_id, JobPhase::kCancelled, "");
    NoteEndedJobs();
  }
  SettleEndedJobs();
  const MutexLock lock(&mutex_);
  const bool settled =
      std::find(unsettled_jobs_.begin(), unsettled_jobs_.end(), job_id) == unsettled_jobs_.end();
  return settled ? absl::OkStatus() : disk_status_;
}

absl::Status Farm::SetPaused(uint64_t job_id, bool paused) {
  const MutexLock settling(&settle_mutex_);  // No end or new beginning is written meanwhile.
  {
    const MutexLock lock(&mutex_);
    const absl::StatusOr<const JobRecord*> job = FindRecord(job_id);
    if (!job.ok()) return job.status();
    absl::Status live = RequireUnfinished(**job, paused ? "be paused" : "be resumed");
    if (!live.ok()) return live;
    if ((*job)->Paused() == paused) return absl::OkStatus();
  }
  absl::Status written = store_->SetPaused(job_id, paused);
  NoteDisk(written);
  if (!written.ok()) return written;
  {
    const MutexLock lock(&mutex_);
    if (paused) {
      scheduler_.Pause(job_id, SteadyTime::Now());
    } else {
      scheduler_.Resume(job_id, SteadyTime::Now());
    }
  }
  LogInfo(absl::StrCat("job ", job_id, paused ? " is paused" : " is resumed"));
  Changed();
  return absl::OkStatus();
}

absl::Status Farm::PauseJob(uint64_t job_id) { return SetPaused(job_id, true); }
absl::Status Farm::ResumeJob(uint64_t job_id) { return SetPaused(job_id, false); }

absl::Status Farm::SetJobPriority(uint64_t job_id, int32_t priority) {
  const MutexLock settling(&settle_mutex_);
  {
    const MutexLock lock(&mutex_);
    const absl::StatusOr<const JobRecord*> job = FindRecord(job_id);
    if (!job.ok()) return job.status();
    if (absl::Status status = scheduler_.CheckPriority(priority); !status.ok()) return status;
    absl::Status live = RequireUnfinished(**job, "change its priority");
    if (!live.ok()) return live;
    if ((*job)->spec.priority == priority) return absl::OkStatus();
  }
  absl::Status written = store_->SetPriority(job_id, priority);
  NoteDisk(written);
  if (!written.ok()) return written;
  {
    const MutexLock lock(&mutex_);
    scheduler_.SetPriority(job_id, priority);
  }
  LogInfo(absl::StrCat("job ", job_id, ": priority ", priority));
  Changed();
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
