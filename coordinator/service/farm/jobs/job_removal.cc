// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/jobs/job_removal.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"

namespace sheaf::coordinator {

absl::Status JobRemoval::RequireUnused(uint64_t job_id) const {
  const absl::StatusOr<const JobRecord*> job = context_.tables.FindJob(job_id);
  if (!job.ok()) return job.status();
  const bool is_unsettled =
      std::find(context_.tables.unsettled_jobs.begin(), context_.tables.unsettled_jobs.end(),
                job_id) != context_.tables.unsettled_jobs.end();
  std::string why;
  if ((*job)->phase == JobPhase::kLive || is_unsettled) {
    why = "has not ended; cancel it first";
  } else if (context_.tables.accounts.at(job_id).pinned) {
    why = "is pinned; unpin it first";
  } else if (context_.tables.scheduler.IsAwaited(job_id)) {
    why = "is awaited by another job; release or cancel that one first";
  } else {
    return absl::OkStatus();
  }
  return absl::FailedPreconditionError(absl::StrCat("jobs/", job_id, ": ", why));
}

absl::Status JobRemoval::RemoveParts(uint64_t job_id, absl::Time now) {
  const MutexLock settling(&context_.settle_mutex);
  std::vector<FrameId> frames;
  {
    const MutexLock lock(&context_.tables.mutex);
    if (absl::Status unused = RequireUnused(job_id); !unused.ok()) return unused;
    for (const FrameRecord& frame : context_.tables.scheduler.jobs().at(job_id).frames) {
      frames.push_back({job_id, frame.number()});
    }
  }
  absl::Status status = context_.store.ChangeJob(job_id, {.parts_removed_time = now});
  if (status.ok()) {
    const MutexLock lock(&context_.tables.mutex);
    context_.tables.accounts.at(job_id).parts_removed_time = now;
  }
  for (const FrameId& frame : frames) {
    if (status.ok()) status = context_.store.RemoveFrameParts(frame);
  }
  context_.disk.Note(status);
  context_.signals.Changed();
  return status;
}

absl::Status JobRemoval::RemovePreviews(uint64_t job_id) {
  const MutexLock settling(&context_.settle_mutex);
  {
    const MutexLock lock(&context_.tables.mutex);
    const absl::Status unused = RequireUnused(job_id);
    if (!unused.ok() && !absl::IsNotFound(unused)) return unused;  // Or left of a removed job.
  }
  context_.previews.RemoveJob(job_id);
  context_.signals.Changed();
  return absl::OkStatus();
}

absl::Status JobRemoval::RemoveJob(uint64_t job_id) {
  const MutexLock settling(&context_.settle_mutex);
  {
    const MutexLock lock(&context_.tables.mutex);
    if (absl::Status found = RequireUnused(job_id); !found.ok()) return found;
    const absl::Duration age_min = context_.options.retention.job_age_min;
    if (context_.tables.accounts.at(job_id).EndedWithin(age_min, SteadyTime::Now())) {
      return absl::FailedPreconditionError(absl::StrCat("jobs/", job_id, " has only just ended"));
    }
  }
  return RemoveUnused(job_id);
}

absl::Status JobRemoval::DeleteJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  const MutexLock settling(&context_.settle_mutex);
  return RemoveUnused(job_id);
}

absl::Status JobRemoval::RemoveUnused(uint64_t job_id) {
  {
    const MutexLock lock(&context_.tables.mutex);
    if (absl::Status unused = RequireUnused(job_id); !unused.ok()) return unused;
  }
  absl::Status removed = context_.store.RemoveJob(job_id);
  context_.disk.Note(removed);
  if (!removed.ok()) return removed;
  context_.previews.RemoveJob(job_id);
  {
    const MutexLock lock(&context_.tables.mutex);
    context_.tables.scheduler.NoteRemoved(job_id);
    context_.tables.scheduler.RemoveJob(job_id);
    context_.tables.accounts.erase(job_id);
    context_.tables.unsaved_failures.erase(job_id);
    std::erase_if(context_.tables.unsaved_troubles, [job_id](const auto& trouble) {
      return trouble.first.frame.job_id == job_id;
    });
    std::erase_if(context_.tables.stale_fields,
                  [job_id](const FrameId& id) { return id.job_id == job_id; });
  }
  LogInfo(absl::StrCat("job ", job_id, " is removed"));
  context_.signals.Changed();
  return absl::OkStatus();
}

uint64_t JobRemoval::ReopenCount() {
  const MutexLock settling(&context_.settle_mutex);
  return context_.reopen_count;
}

bool JobRemoval::IfNoneReopened(uint64_t seen, const std::function<void()>& act) {
  const MutexLock settling(&context_.settle_mutex);
  if (context_.reopen_count != seen) return false;
  act();
  return true;
}

}  // namespace sheaf::coordinator
