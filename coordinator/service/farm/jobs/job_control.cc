// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/jobs/job_control.h"

#include <algorithm>
#include <chrono>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/log.h"
#include "coordinator/core/job/cell_grid.h"
#include "coordinator/service/farm/jobs/job_continuation.h"
#include "coordinator/service/farm/jobs/job_reopening.h"
#include "coordinator/service/farm/jobs/job_restore.h"

namespace sheaf::coordinator {
namespace {

// Errors: kFailedPrecondition, naming the job's state, if it has ended.
absl::Status RequireUnfinished(const JobRecord& job, const char* action) {
  if (job.phase == JobPhase::kLive) return absl::OkStatus();
  const char* const state = job.phase == JobPhase::kSucceeded ? "has succeeded"
                            : job.phase == JobPhase::kFailed  ? "has failed"
                                                              : "was cancelled";
  return absl::FailedPreconditionError(
      absl::StrCat("jobs/", job.spec.job_id, " ", state, "; only an unfinished job can ", action));
}

}  // namespace

absl::StatusOr<uint64_t> JobControl::Create(JobSpec spec, const std::string& request_id) {
  if (spec.dependencies.empty()) return CreateNew(std::move(spec), request_id);
  const MutexLock settling(&context_.settle_mutex);
  return CreateNew(std::move(spec), request_id);
}

absl::StatusOr<uint64_t> JobControl::CreateNew(JobSpec spec, const std::string& request_id) {
  const absl::StatusOr<std::optional<uint64_t>> existing = context_.store.FindRequest(request_id);
  if (!existing.ok()) return existing.status();
  if (existing->has_value()) return **existing;
  spec.numeric_profile = context_.numeric_profile;
  std::sort(spec.frames.begin(), spec.frames.end(),
            [](const FrameSpec& a, const FrameSpec& b) { return a.frame_number < b.frame_number; });
  for (FrameSpec& frame : spec.frames) {
    frame.frame_digest =
        FrameDigest(frame.scene.sha256_hex, frame.settings, context_.numeric_profile);
  }
  {
    const MutexLock lock(&context_.tables.mutex);
    if (absl::Status status = context_.tables.scheduler.CheckJob(spec); !status.ok()) return status;
    // Concurrent calls of one owner may exceed a limit by the jobs that they submit.
    if (absl::Status status = context_.tables.scheduler.CheckOwner(spec); !status.ok())
      return status;
  }
  if (spec.partition.cell_size_px == 0) {
    // Also for frames without a rule: a refinement may add one.
    for (const FrameSpec& frame : spec.frames) {
      const int32_t size = ChooseCellSize(frame.settings.window, spec.partition.tile_size_px);
      spec.partition.cell_size_px = std::max(spec.partition.cell_size_px, size);
    }
  }
  StoredJob job;
  job.spec = std::move(spec);
  const absl::StatusOr<ResumedCounts> resumed =
      context_.resumed.Count(job.spec.frames, job.spec.partition);
  if (!resumed.ok()) return resumed.status();
  const absl::Time now = absl::Now();
  const absl::StatusOr<JobStore::CreatedJob> created =
      context_.store.CreateJob(job.spec, request_id, now);
  context_.disk.Note(created.status());
  if (!created.ok()) return created.status();
  if (created->is_new) {
    const MutexLock lock(&context_.tables.mutex);
    job.spec.job_id = created->job_id;
    context_.tables.accounts[job.spec.job_id].create_time = now;
    const JobStore::LoadedParts none;
    RestoreJob(context_, job, /*rounds=*/{}, &none, *resumed);
    const size_t frame_count = job.spec.frames.size();
    LogInfo(absl::StrCat("job ", job.spec.job_id, ": \"", job.spec.title, "\", ", frame_count,
                         frame_count == 1 ? " frame" : " frames"));
  }
  context_.signals.Changed();
  return created->job_id;
}

absl::Status JobControl::CancelJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  {
    const MutexLock lock(&context_.tables.mutex);
    const absl::StatusOr<const JobRecord*> job = context_.tables.FindJob(job_id);
    if (!job.ok()) return job.status();
    if ((*job)->phase != JobPhase::kCancelled) {  // A second call waits for the first.
      absl::Status live = RequireUnfinished(**job, "be cancelled");
      if (!live.ok()) return live;
    }
    context_.tables.scheduler.EndJob(job_id, JobPhase::kCancelled, "");
    context_.tables.NoteEndedJobs();
  }
  ends_.SettleEnded();
  const MutexLock lock(&context_.tables.mutex);
  const bool settled =
      std::find(context_.tables.unsettled_jobs.begin(), context_.tables.unsettled_jobs.end(),
                job_id) == context_.tables.unsettled_jobs.end();
  return settled ? absl::OkStatus() : context_.disk.Last();
}

absl::Status JobControl::PauseJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  return SetPaused(job_id, true);
}

absl::Status JobControl::ResumeJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  return SetPaused(job_id, false);
}

absl::Status JobControl::SetPaused(uint64_t job_id, bool paused) {
  const MutexLock settling(
      &context_.settle_mutex);  // No end or new beginning is written meanwhile.
  {
    const MutexLock lock(&context_.tables.mutex);
    const absl::StatusOr<const JobRecord*> job = context_.tables.FindJob(job_id);
    if (!job.ok()) return job.status();
    absl::Status live = RequireUnfinished(**job, paused ? "be paused" : "be resumed");
    if (!live.ok()) return live;
  }
  // Written even if nothing changes: an earlier write that failed may reappear after a power cut.
  absl::Status written = context_.store.ChangeJob(job_id, {.paused = paused});
  context_.disk.Note(written);
  if (!written.ok()) return written;
  {
    const MutexLock lock(&context_.tables.mutex);
    if (paused) {
      context_.tables.scheduler.Pause(job_id, SteadyTime::Now());
    } else {
      context_.tables.scheduler.Resume(job_id, SteadyTime::Now());
    }
  }
  LogInfo(absl::StrCat("job ", job_id, paused ? " is paused" : " is resumed"));
  context_.signals.Changed();
  return absl::OkStatus();
}

absl::Status JobControl::SetJobPriority(uint64_t job_id, const JobArguments& arguments) {
  const int32_t priority = arguments.priority;
  const MutexLock settling(&context_.settle_mutex);
  {
    const MutexLock lock(&context_.tables.mutex);
    const absl::StatusOr<const JobRecord*> job = context_.tables.FindJob(job_id);
    if (!job.ok()) return job.status();
    if (absl::Status status = context_.tables.scheduler.CheckPriority(priority); !status.ok())
      return status;
    absl::Status live = RequireUnfinished(**job, "change its priority");
    if (!live.ok()) return live;
  }
  // Written even if it has the priority, as in SetPaused.
  absl::Status written = context_.store.ChangeJob(job_id, {.priority = priority});
  context_.disk.Note(written);
  if (!written.ok()) return written;
  {
    const MutexLock lock(&context_.tables.mutex);
    context_.tables.scheduler.SetPriority(job_id, priority);
  }
  LogInfo(absl::StrCat("job ", job_id, ": priority ", priority));
  context_.signals.Changed();
  return absl::OkStatus();
}

absl::Status JobControl::ReleaseJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  const MutexLock settling(
      &context_.settle_mutex);  // No end or new beginning is written meanwhile.
  {
    const MutexLock lock(&context_.tables.mutex);
    const absl::StatusOr<const JobRecord*> job = context_.tables.FindJob(job_id);
    if (!job.ok()) return job.status();
    if ((*job)->spec.dependencies.empty()) {
      return absl::FailedPreconditionError(absl::StrCat(
          "jobs/", job_id, " waits for no other job; sheaf resume ends a pause, sheaf approve ",
          "a wait for approval"));
    }
    if (absl::Status there = RequireNotGivenUp(**job); !there.ok()) return there;
  }
  // Written even if nothing changes, as in SetPaused.
  absl::Status written = context_.store.ReleaseJob(job_id);
  context_.disk.Note(written);
  if (!written.ok()) return written;
  {
    const MutexLock lock(&context_.tables.mutex);
    context_.tables.scheduler.Release(job_id);
  }
  LogInfo(absl::StrCat("job ", job_id, " is released: it waits for no other job"));
  context_.signals.Changed();
  return absl::OkStatus();
}

absl::Status JobControl::PinJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  return SetPinned(job_id, true);
}

absl::Status JobControl::UnpinJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  return SetPinned(job_id, false);
}

absl::Status JobControl::SetPinned(uint64_t job_id, bool pinned) {
  const MutexLock settling(&context_.settle_mutex);  // Nothing of it is removed meanwhile.
  {
    const MutexLock lock(&context_.tables.mutex);
    if (absl::Status there = context_.tables.FindJob(job_id).status(); !there.ok()) return there;
  }
  // Written even if nothing changes, as in SetPaused.
  absl::Status written = context_.store.ChangeJob(job_id, {.pinned = pinned});
  context_.disk.Note(written);
  if (!written.ok()) return written;
  {
    const MutexLock lock(&context_.tables.mutex);
    context_.tables.accounts.at(job_id).pinned = pinned;
  }
  LogInfo(absl::StrCat("job ", job_id, pinned ? " is pinned" : " is no longer pinned"));
  context_.signals.Changed();
  return absl::OkStatus();
}

absl::Status JobControl::KillTasks(uint64_t job_id, const JobArguments& arguments) {
  if (!arguments.frame) return absl::InvalidArgumentError("a frame to kill is missing");
  const FrameId id{job_id, *arguments.frame};
  const std::optional<uint32_t> task = arguments.task;
  const std::string why = absl::StrCat("killed by ", arguments.user);
  {
    const MutexLock settling(&context_.settle_mutex);  // No new beginning is written meanwhile.
    {
      const MutexLock lock(&context_.tables.mutex);
      const absl::StatusOr<const JobRecord*> found = context_.tables.FindJob(id.job_id);
      if (!found.ok()) return found.status();
      absl::Status killed = context_.tables.scheduler.Kill(id, task, why);
      context_.tables.NoteEndedJobs();
      if (!killed.ok()) return killed;
    }
    if (absl::Status saved = SaveNewTroubles(context_); !saved.ok()) return saved;
  }
  LogInfo(absl::StrCat("job ", id.job_id, NameOfWork(id.frame_number, task), ": ", why));
  ends_.SettleEnded();
  context_.signals.Changed();
  return absl::OkStatus();
}

void JobControl::NotePilotRequest(uint64_t job_id) {
  const MutexLock lock(&context_.tables.mutex);
  const auto pilot = context_.tables.pilots_asked.find(job_id);
  if (pilot != context_.tables.pilots_asked.end()) pilot->second = std::chrono::steady_clock::now();
}

absl::Status JobControl::LiftQuarantine(const std::string& identity) {
  const MutexLock settling(&context_.settle_mutex);
  {
    // Without its row a start would not resume the removal.
    const MutexLock lock(&context_.tables.mutex);
    if (std::find(context_.tables.liars.begin(), context_.tables.liars.end(), identity) !=
        context_.tables.liars.end()) {
      return absl::FailedPreconditionError(
          absl::StrCat("the false results of ", identity,
                       " are still being removed; trust it again when that is done"));
    }
  }
  // So that a pending one does not return.
  if (absl::Status saved = SaveNewQuarantines(context_); !saved.ok()) return saved;
  absl::Status removed = context_.store.RemoveQuarantine(identity);
  context_.disk.Note(removed);
  if (!removed.ok()) return removed;
  {
    const MutexLock lock(&context_.tables.mutex);
    if (!context_.tables.scheduler.LiftQuarantine(identity)) return absl::OkStatus();
  }
  LogInfo(absl::StrCat("the quarantine of ", identity, " is lifted"));
  context_.signals.Changed();
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
