// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/jobs/job_lifecycle.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/log.h"
#include "coordinator/core/job/cell_grid.h"

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

absl::StatusOr<uint64_t> JobLifecycle::Create(JobSpec spec, const std::string& request_id) {
  if (spec.dependencies.empty()) return CreateNew(std::move(spec), request_id);
  const MutexLock settling(&settle_mutex_);
  return CreateNew(std::move(spec), request_id);
}

absl::StatusOr<uint64_t> JobLifecycle::CreateNew(JobSpec spec, const std::string& request_id) {
  const absl::StatusOr<std::optional<uint64_t>> existing = store_.FindRequest(request_id);
  if (!existing.ok()) return existing.status();
  if (existing->has_value()) return **existing;
  spec.numeric_profile = numeric_profile_;
  std::sort(spec.frames.begin(), spec.frames.end(),
            [](const FrameSpec& a, const FrameSpec& b) { return a.frame_number < b.frame_number; });
  for (FrameSpec& frame : spec.frames) {
    frame.frame_digest = FrameDigest(frame.scene.sha256_hex, frame.settings, numeric_profile_);
  }
  {
    const MutexLock lock(&tables_.mutex);
    if (absl::Status status = tables_.scheduler.CheckJob(spec); !status.ok()) return status;
    // Concurrent calls of one owner may exceed a limit by the jobs that they submit.
    if (absl::Status status = tables_.scheduler.CheckOwner(spec); !status.ok()) return status;
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
  const absl::StatusOr<ResumedCounts> resumed = resumed_.Count(job.spec.frames, job.spec.partition);
  if (!resumed.ok()) return resumed.status();
  const absl::Time now = absl::Now();
  const absl::StatusOr<JobStore::CreatedJob> created = store_.CreateJob(job.spec, request_id, now);
  disk_.Note(created.status());
  if (!created.ok()) return created.status();
  if (created->is_new) {
    const MutexLock lock(&tables_.mutex);
    job.spec.job_id = created->job_id;
    tables_.accounts[job.spec.job_id].create_time = now;
    const JobStore::LoadedParts none;
    RestoreJob(job, /*rounds=*/{}, &none, *resumed);
    const size_t frame_count = job.spec.frames.size();
    LogInfo(absl::StrCat("job ", job.spec.job_id, ": \"", job.spec.title, "\", ", frame_count,
                         frame_count == 1 ? " frame" : " frames"));
  }
  signals_.Changed();
  return created->job_id;
}

absl::Status JobLifecycle::CancelJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  {
    const MutexLock lock(&tables_.mutex);
    const absl::StatusOr<const JobRecord*> job = tables_.FindJob(job_id);
    if (!job.ok()) return job.status();
    if ((*job)->phase != JobPhase::kCancelled) {  // A second call waits for the first.
      absl::Status live = RequireUnfinished(**job, "be cancelled");
      if (!live.ok()) return live;
    }
    tables_.scheduler.EndJob(job_id, JobPhase::kCancelled, "");
    tables_.NoteEndedJobs();
  }
  SettleEnded();
  const MutexLock lock(&tables_.mutex);
  const bool settled = std::find(tables_.unsettled_jobs.begin(), tables_.unsettled_jobs.end(),
                                 job_id) == tables_.unsettled_jobs.end();
  return settled ? absl::OkStatus() : disk_.Last();
}

absl::Status JobLifecycle::PauseJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  return SetPaused(job_id, true);
}

absl::Status JobLifecycle::ResumeJob(uint64_t job_id, const JobArguments& /*arguments*/) {
  return SetPaused(job_id, false);
}

absl::Status JobLifecycle::SetPaused(uint64_t job_id, bool paused) {
  const MutexLock settling(&settle_mutex_);  // No end or new beginning is written meanwhile.
  {
    const MutexLock lock(&tables_.mutex);
    const absl::StatusOr<const JobRecord*> job = tables_.FindJob(job_id);
    if (!job.ok()) return job.status();
    absl::Status live = RequireUnfinished(**job, paused ? "be paused" : "be resumed");
    if (!live.ok()) return live;
  }
  // Written even if nothing changes: an earlier write that failed may reappear after a power cut.
  absl::Status written = store_.SetPaused(job_id, paused);
  disk_.Note(written);
  if (!written.ok()) return written;
  {
    const MutexLock lock(&tables_.mutex);
    if (paused) {
      tables_.scheduler.Pause(job_id, SteadyTime::Now());
    } else {
      tables_.scheduler.Resume(job_id, SteadyTime::Now());
    }
  }
  LogInfo(absl::StrCat("job ", job_id, paused ? " is paused" : " is resumed"));
  signals_.Changed();
  return absl::OkStatus();
}

absl::Status JobLifecycle::SetJobPriority(uint64_t job_id, const JobArguments& arguments) {
  const int32_t priority = arguments.priority;
  const MutexLock settling(&settle_mutex_);
  {
    const MutexLock lock(&tables_.mutex);
    const absl::StatusOr<const JobRecord*> job = tables_.FindJob(job_id);
    if (!job.ok()) return job.status();
    if (absl::Status status = tables_.scheduler.CheckPriority(priority); !status.ok())
      return status;
    absl::Status live = RequireUnfinished(**job, "change its priority");
    if (!live.ok()) return live;
  }
  // Written even if it has the priority, as in SetPaused.
  absl::Status written = store_.SetPriority(job_id, priority);
  disk_.Note(written);
  if (!written.ok()) return written;
  {
    const MutexLock lock(&tables_.mutex);
    tables_.scheduler.SetPriority(job_id, priority);
  }
  LogInfo(absl::StrCat("job ", job_id, ": priority ", priority));
  signals_.Changed();
  return absl::OkStatus();
}

void JobLifecycle::NotePilotRequest(uint64_t job_id) {
  const MutexLock lock(&tables_.mutex);
  const auto pilot = tables_.pilots_asked.find(job_id);
  if (pilot != tables_.pilots_asked.end()) pilot->second = std::chrono::steady_clock::now();
}

bool JobLifecycle::Tick() {
  const MutexLock lock(&tables_.mutex);
  const bool changed = tables_.scheduler.Tick(SteadyTime::Now());
  CancelForgottenPilots();
  tables_.NoteEndedJobs();
  return changed;
}

void JobLifecycle::CancelForgottenPilots() {
  const auto now = std::chrono::steady_clock::now();
  std::vector<uint64_t> forgotten;
  for (const auto& [id, asked] : tables_.pilots_asked) {
    if (absl::FromChrono(now - asked) > options_.limits.pilot_unasked_max) forgotten.push_back(id);
  }
  for (const uint64_t id : forgotten) {
    LogInfo(absl::StrCat("job ", id, ": no client waits for this pilot"));
    tables_.scheduler.EndJob(id, JobPhase::kCancelled, "");
  }
}

void JobLifecycle::SettleEnded() {
  struct Ended {
    uint64_t job_id;
    JobPhase phase;
    std::string failure;
    std::vector<FrameId> frames;
    absl::Time time;
    absl::Duration wall;
  };
  const MutexLock settling(&settle_mutex_);
  SaveNewFailures();  // Before the end, so that a failed job always has its reasons.
  SaveNewQuarantines();
  std::vector<Ended> ended;
  {
    const MutexLock lock(&tables_.mutex);
    for (const uint64_t id : std::exchange(tables_.unsettled_jobs, {})) {
      const JobRecord& job = tables_.scheduler.jobs().at(id);
      const absl::Time end_time = tables_.accounts.at(id).end_time;
      Ended entry{id, job.phase, job.failure,
                  {}, end_time,  tables_.WallOfJob(job, tables_.accounts.at(id).ended)};
      for (auto it = tables_.open_frames.lower_bound({id, INT32_MIN});
           it != tables_.open_frames.end() && it->first.job_id == id; ++it) {
        entry.frames.push_back(it->first);
      }
      ended.push_back(std::move(entry));
    }
  }
  for (const Ended& job : ended) {
    absl::Status status = store_.EndJob(job.job_id, job.phase, job.failure, job.time, job.wall);
    disk_.Note(status);
    if (!status.ok()) {
      const MutexLock lock(&tables_.mutex);
      tables_.unsettled_jobs.push_back(job.job_id);
      continue;
    }
    if (job.phase == JobPhase::kFailed) {
      const std::string text = absl::StrCat("job ", job.job_id, " failed: ", job.failure);
      options_.warns_of_failed_jobs ? LogWarning(text) : LogInfo(text);
    } else {
      LogInfo(absl::StrCat("job ", job.job_id,
                           job.phase == JobPhase::kSucceeded ? " succeeded" : " was cancelled"));
    }
    // A failed job keeps its parts for another try (LimitKeptParts).
    const bool keeps_parts = job.phase == JobPhase::kFailed && !IsPilot(job.job_id);
    for (const FrameId& frame : job.frames) {
      if (keeps_parts) continue;
      disk_.Note(store_.RemoveFrameParts(frame));
      previews_.RemoveFrom(frame, 0);
    }
    EraseOpenFrames(job.job_id);
  }
  if (ended.empty()) return;
  signals_.Changed();
  signals_.JobsEnded(ended.size());
}

void JobLifecycle::SaveFailures() {
  const MutexLock settling(&settle_mutex_);
  SaveNewFailures();
  SaveNewQuarantines();
}

absl::Status JobLifecycle::SaveNewTroubles() {
  std::map<TaskId, TaskTrouble> changed;
  std::vector<TaskTrouble> troubles;
  {
    const MutexLock lock(&tables_.mutex);
    changed = std::exchange(tables_.unsaved_troubles, {});
  }
  if (changed.empty()) return absl::OkStatus();
  troubles.reserve(changed.size());
  for (const auto& [id, trouble] : changed) troubles.push_back(trouble);
  absl::Status status = store_.WriteTroubles(troubles);
  disk_.Note(status);
  if (status.ok()) return status;
  const MutexLock lock(&tables_.mutex);
  tables_.unsaved_troubles.merge(changed);  // Keeps newer ones.
  return status;
}

void JobLifecycle::SaveNewQuarantines() {
  std::vector<QuarantineRecord> records;
  {
    const MutexLock lock(&tables_.mutex);
    records = std::exchange(tables_.unsaved_quarantines, {});
  }
  for (QuarantineRecord& record : records) {
    const absl::Status status = store_.WriteQuarantine(record);
    disk_.Note(status);
    if (status.ok()) continue;
    const MutexLock lock(&tables_.mutex);
    tables_.unsaved_quarantines.push_back(std::move(record));
  }
}

absl::Status JobLifecycle::LiftQuarantine(const std::string& identity) {
  const MutexLock settling(&settle_mutex_);
  {
    // Without its row a start would not resume the removal.
    const MutexLock lock(&tables_.mutex);
    if (std::find(tables_.liars.begin(), tables_.liars.end(), identity) != tables_.liars.end()) {
      return absl::FailedPreconditionError(
          absl::StrCat("the false results of ", identity,
                       " are still being removed; trust it again when that is done"));
    }
  }
  SaveNewQuarantines();  // So that a pending one does not return.
  absl::Status removed = store_.RemoveQuarantine(identity);
  disk_.Note(removed);
  if (!removed.ok()) return removed;
  {
    const MutexLock lock(&tables_.mutex);
    if (!tables_.scheduler.LiftQuarantine(identity)) return absl::OkStatus();
  }
  LogInfo(absl::StrCat("the quarantine of ", identity, " is lifted"));
  signals_.Changed();
  return absl::OkStatus();
}

void JobLifecycle::SaveNewFailures() {
  SaveNewTroubles().IgnoreError();  // The disk's state is noted.
  std::map<uint64_t, FailureLog> logs;
  {
    const MutexLock lock(&tables_.mutex);
    for (const uint64_t id : std::exchange(tables_.unsaved_failures, {})) {
      const auto job = tables_.scheduler.jobs().find(id);
      if (job != tables_.scheduler.jobs().end()) logs[id] = job->second.failures;
    }
  }
  for (const auto& [id, log] : logs) {
    const absl::Status status = store_.WriteFailures(id, log);
    disk_.Note(status);
    if (status.ok()) continue;
    const MutexLock lock(&tables_.mutex);
    tables_.unsaved_failures.insert(id);
  }
}

void JobLifecycle::EraseOpenFrames(uint64_t job_id) {
  const MutexLock lock(&tables_.mutex);
  tables_.open_frames.erase(tables_.open_frames.lower_bound({job_id, INT32_MIN}),
                            tables_.open_frames.upper_bound({job_id, INT32_MAX}));
}

void JobLifecycle::LimitKeptParts() {
  // No frame may be reopened meanwhile: its parts would be removed.
  const MutexLock settling(&settle_mutex_);
  while (store_.PartsBytes() > options_.kept_parts_bytes_max) {
    const absl::StatusOr<std::optional<FrameId>> oldest = store_.OldestDeliveredWithParts();
    disk_.Note(oldest.status());
    if (!oldest.ok() || !oldest->has_value()) return;
    const absl::Status removed = store_.RemoveFrameParts(**oldest);
    disk_.Note(removed);
    if (!removed.ok()) return;
  }
}

}  // namespace sheaf::coordinator
