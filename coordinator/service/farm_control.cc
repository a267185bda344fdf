// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Farm that does what people want of a job: wait, go on, or go before others.
#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/log.h"
#include "coordinator/service/farm.h"

namespace sheaf::coordinator {

absl::StatusOr<const JobRecord*> Farm::FindRecord(uint64_t job_id) const {
  const auto found = scheduler_.jobs().find(job_id);
  if (found != scheduler_.jobs().end()) return &found->second;
  return absl::NotFoundError(absl::StrCat("jobs/", job_id, ": there is no such job"));
}

absl::Status Farm::SetPaused(uint64_t job_id, bool paused) {
  const std::lock_guard settling(settle_mutex_);  // No end or new beginning is written meanwhile.
  {
    const std::lock_guard lock(mutex_);
    const absl::StatusOr<const JobRecord*> job = FindRecord(job_id);
    if (!job.ok()) return job.status();
    if ((*job)->phase != JobPhase::kLive || (*job)->Paused() == paused) return absl::OkStatus();
  }
  absl::Status written = store_->SetPaused(job_id, paused);
  NoteDisk(written);
  if (!written.ok()) return written;
  {
    const std::lock_guard lock(mutex_);
    if (paused) {
      scheduler_.Pause(job_id, absl::Now());
    } else {
      scheduler_.Resume(job_id, absl::Now());
    }
  }
  LogInfo(absl::StrCat("job ", job_id, paused ? " is paused" : " goes on"));
  Changed();
  return absl::OkStatus();
}

absl::Status Farm::PauseJob(uint64_t job_id) { return SetPaused(job_id, true); }
absl::Status Farm::ResumeJob(uint64_t job_id) { return SetPaused(job_id, false); }

absl::Status Farm::SetJobPriority(uint64_t job_id, int32_t priority) {
  const std::lock_guard settling(settle_mutex_);
  {
    const std::lock_guard lock(mutex_);
    const absl::StatusOr<const JobRecord*> job = FindRecord(job_id);
    if (!job.ok()) return job.status();
    if (absl::Status status = scheduler_.CheckPriority(priority); !status.ok()) return status;
    if ((*job)->spec.priority == priority) return absl::OkStatus();
  }
  absl::Status written = store_->SetPriority(job_id, priority);
  NoteDisk(written);
  if (!written.ok()) return written;
  {
    const std::lock_guard lock(mutex_);
    scheduler_.SetPriority(job_id, priority);
  }
  LogInfo(absl::StrCat("job ", job_id, ": priority ", priority));
  Changed();
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
