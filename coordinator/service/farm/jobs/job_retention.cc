// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of JobLifecycle that pins jobs, and removes stored data of ended jobs. A removal is
// durable before its files are removed.
#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "coordinator/service/farm/jobs/job_lifecycle.h"

namespace sheaf::coordinator {

absl::Status JobLifecycle::PinJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  return SetPinned(job_id, true);
}

absl::Status JobLifecycle::UnpinJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  return SetPinned(job_id, false);
}

absl::Status JobLifecycle::SetPinned(uint64_t job_id, bool pinned) {
  const MutexLock settling(&settle_mutex_);  // Nothing of it is removed meanwhile.
  {
    const MutexLock lock(&tables_.mutex);
    if (absl::Status there = tables_.FindJob(job_id).status(); !there.ok()) return there;
  }
  // Written even if nothing changes, as in SetPaused.
  absl::Status written = store_.SetPinned(job_id, pinned);
  disk_.Note(written);
  if (!written.ok()) return written;
  {
    const MutexLock lock(&tables_.mutex);
    tables_.accounts.at(job_id).pinned = pinned;
  }
  LogInfo(absl::StrCat("job ", job_id, pinned ? " is pinned" : " is no longer pinned"));
  signals_.Changed();
  return absl::OkStatus();
}

absl::Status JobLifecycle::RequireUnused(uint64_t job_id) const {
  const absl::StatusOr<const JobRecord*> job = tables_.FindJob(job_id);
  if (!job.ok()) return job.status();
  const bool is_unsettled = std::find(tables_.unsettled_jobs.begin(), tables_.unsettled_jobs.end(),
                                      job_id) != tables_.unsettled_jobs.end();
  const bool is_kept = tables_.accounts.at(job_id).pinned || tables_.scheduler.IsAwaited(job_id);
  if ((*job)->phase != JobPhase::kLive && !is_unsettled && !is_kept) return absl::OkStatus();
  return absl::FailedPreconditionError(
      absl::StrCat("jobs/", job_id, " is pinned, has not ended, or another job waits for it"));
}

absl::Status JobLifecycle::RemoveParts(uint64_t job_id, absl::Time now) {
  const MutexLock settling(&settle_mutex_);
  std::vector<FrameId> frames;
  {
    const MutexLock lock(&tables_.mutex);
    if (absl::Status unused = RequireUnused(job_id); !unused.ok()) return unused;
    for (const FrameRecord& frame : tables_.scheduler.jobs().at(job_id).frames) {
      frames.push_back({job_id, frame.number()});
    }
  }
  absl::Status status = store_.NotePartsRemoved(job_id, now);
  if (status.ok()) {
    const MutexLock lock(&tables_.mutex);
    tables_.accounts.at(job_id).parts_removed_time = now;
  }
  for (const FrameId& frame : frames) {
    if (status.ok()) status = store_.RemoveFrameParts(frame);
  }
  disk_.Note(status);
  signals_.Changed();
  return status;
}

absl::Status JobLifecycle::RemovePreviews(uint64_t job_id) {
  const MutexLock settling(&settle_mutex_);
  {
    const MutexLock lock(&tables_.mutex);
    const absl::Status unused = RequireUnused(job_id);
    if (!unused.ok() && !absl::IsNotFound(unused)) return unused;  // Or left of a removed job.
  }
  previews_.RemoveJob(job_id);
  signals_.Changed();
  return absl::OkStatus();
}

absl::Status JobLifecycle::RemoveJob(uint64_t job_id) {
  const MutexLock settling(&settle_mutex_);
  {
    const MutexLock lock(&tables_.mutex);
    if (absl::Status found = RequireUnused(job_id); !found.ok()) return found;
    const absl::Duration age_min = options_.retention.job_age_min;
    if (tables_.accounts.at(job_id).EndedWithin(age_min, SteadyTime::Now())) {
      return absl::FailedPreconditionError(absl::StrCat("jobs/", job_id, " has only just ended"));
    }
  }
  return RemoveUnused(job_id);
}

absl::Status JobLifecycle::DeleteJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  const MutexLock settling(&settle_mutex_);
  return RemoveUnused(job_id);
}

absl::Status JobLifecycle::RemoveUnused(uint64_t job_id) {
  {
    const MutexLock lock(&tables_.mutex);
    if (absl::Status unused = RequireUnused(job_id); !unused.ok()) return unused;
  }
  absl::Status removed = store_.RemoveJob(job_id);
  disk_.Note(removed);
  if (!removed.ok()) return removed;
  previews_.RemoveJob(job_id);
  {
    const MutexLock lock(&tables_.mutex);
    tables_.scheduler.NoteRemoved(job_id);
    tables_.scheduler.RemoveJob(job_id);
    tables_.accounts.erase(job_id);
    tables_.unsaved_failures.erase(job_id);
    std::erase_if(tables_.stale_fields,
                  [job_id](const FrameId& id) { return id.job_id == job_id; });
  }
  LogInfo(absl::StrCat("job ", job_id, " is removed"));
  signals_.Changed();
  return absl::OkStatus();
}

uint64_t JobLifecycle::ReopenCount() {
  const MutexLock settling(&settle_mutex_);
  return reopen_count_;
}

bool JobLifecycle::IfNoneReopened(uint64_t seen, const std::function<void()>& act) {
  const MutexLock settling(&settle_mutex_);
  if (reopen_count_ != seen) return false;
  act();
  return true;
}

}  // namespace sheaf::coordinator
