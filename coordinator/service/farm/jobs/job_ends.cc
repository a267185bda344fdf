// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/jobs/job_ends.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/base/log.h"

namespace sheaf::coordinator {
namespace {

// The event of a job's end.
const char* WordOfEnd(JobPhase phase) {
  if (phase == JobPhase::kSucceeded) return "succeeded";
  return phase == JobPhase::kFailed ? "failed" : "cancelled";
}

void SaveNewFailures(JobContext& context) ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.settle_mutex) {
  SaveNewTroubles(context).IgnoreError();  // The disk's state is noted.
  std::map<uint64_t, FailureLog> logs;
  {
    const MutexLock lock(&context.tables.mutex);
    for (const uint64_t id : std::exchange(context.tables.unsaved_failures, {})) {
      const auto job = context.tables.scheduler.jobs().find(id);
      if (job != context.tables.scheduler.jobs().end()) logs[id] = job->second.failures;
    }
  }
  for (const auto& [id, log] : logs) {
    const absl::Status status = context.store.WriteFailures(id, log);
    context.disk.Note(status);
    if (status.ok()) continue;
    const MutexLock lock(&context.tables.mutex);
    context.tables.unsaved_failures.insert(id);
  }
}

bool HasUnsavedFailures(JobContext& context, uint64_t job_id)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.tables.mutex) {
  const auto is_of_job = [job_id](const auto& trouble) {
    return trouble.first.frame.job_id == job_id;
  };
  return context.tables.unsaved_failures.contains(job_id) ||
         std::ranges::any_of(context.tables.unsaved_troubles, is_of_job);
}

void EraseOpenFrames(JobContext& context, uint64_t job_id) {
  const MutexLock lock(&context.tables.mutex);
  context.tables.open_frames.erase(context.tables.open_frames.lower_bound({job_id, INT32_MIN}),
                                   context.tables.open_frames.upper_bound({job_id, INT32_MAX}));
}

void CancelForgottenPilots(JobContext& context)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.tables.mutex) {
  const auto now = std::chrono::steady_clock::now();
  std::vector<uint64_t> forgotten;
  for (const auto& [id, asked] : context.tables.pilots_asked) {
    if (absl::FromChrono(now - asked) > context.options.limits.pilot_unasked_max)
      forgotten.push_back(id);
  }
  for (const uint64_t id : forgotten) {
    LogInfo(absl::StrCat("job ", id, ": no client waits for this pilot"));
    context.tables.scheduler.EndJob(id, JobPhase::kCancelled, "");
  }
}

}  // namespace

absl::Status SaveNewTroubles(JobContext& context) {
  std::map<TaskId, TaskTrouble> changed;
  std::vector<TaskTrouble> troubles;
  {
    const MutexLock lock(&context.tables.mutex);
    changed = std::exchange(context.tables.unsaved_troubles, {});
  }
  if (changed.empty()) return absl::OkStatus();
  troubles.reserve(changed.size());
  for (const auto& [id, trouble] : changed) troubles.push_back(trouble);
  absl::Status status = context.store.WriteTroubles(troubles);
  context.disk.Note(status);
  if (status.ok()) return status;
  const MutexLock lock(&context.tables.mutex);
  context.tables.unsaved_troubles.merge(changed);  // Keeps newer ones.
  return status;
}

absl::Status SaveNewQuarantines(JobContext& context) {
  absl::Status refused;
  std::vector<QuarantineRecord> records;
  {
    const MutexLock lock(&context.tables.mutex);
    records = std::exchange(context.tables.unsaved_quarantines, {});
  }
  for (QuarantineRecord& record : records) {
    const absl::Status status = context.store.WriteQuarantine(record);
    context.disk.Note(status);
    if (status.ok()) continue;
    refused = status;
    const MutexLock lock(&context.tables.mutex);
    context.tables.unsaved_quarantines.push_back(std::move(record));
  }
  return refused;
}

void JobEnds::NoteDelivered(const FrameId& id, const DeliveredFrame& delivered) {
  std::string text = absl::StrFormat("%.3g s of CPU time, image %s",
                                     absl::ToDoubleSeconds(delivered.cost.cpu_duration),
                                     delivered.image_digest.substr(0, 12));
  if (delivered.relative_mse > 0) {
    text = absl::StrFormat("error %.3g %%, %s", 100 * std::sqrt(delivered.relative_mse), text);
  }
  context_.journal.Note({.job_id = id.job_id,
                         .what = "delivered",
                         .frame_number = id.frame_number,
                         .text = std::move(text)});
}

bool JobEnds::Tick() {
  const MutexLock lock(&context_.tables.mutex);
  const bool changed = context_.tables.scheduler.Tick(SteadyTime::Now());
  CancelForgottenPilots(context_);
  context_.tables.NoteEndedJobs();
  return changed;
}

void JobEnds::SettleEnded() {
  struct Ended {
    uint64_t job_id;
    JobPhase phase;
    std::string failure;
    std::vector<FrameId> frames;
    absl::Time time;
    absl::Duration wall;
  };
  const MutexLock settling(&context_.settle_mutex);
  SaveNewFailures(context_);  // Before the end, so that a failed job always has its reasons.
  SaveNewQuarantines(context_).IgnoreError();  // The disk's state is noted.
  std::vector<Ended> ended;
  {
    const MutexLock lock(&context_.tables.mutex);
    for (const uint64_t id : std::exchange(context_.tables.unsettled_jobs, {})) {
      if (HasUnsavedFailures(context_, id)) {
        context_.tables.unsettled_jobs.push_back(id);
        continue;
      }
      const JobRecord& job = context_.tables.scheduler.jobs().at(id);
      const absl::Time end_time = context_.tables.accounts.at(id).end_time;
      Ended entry{
          id, job.phase, job.failure,
          {}, end_time,  context_.tables.WallOfJob(job, context_.tables.accounts.at(id).ended)};
      for (auto it = context_.tables.open_frames.lower_bound({id, INT32_MIN});
           it != context_.tables.open_frames.end() && it->first.job_id == id; ++it) {
        entry.frames.push_back(it->first);
      }
      ended.push_back(std::move(entry));
    }
  }
  for (const Ended& job : ended) {
    absl::Status status =
        context_.store.EndJob(job.job_id, job.phase, job.failure, job.time, job.wall);
    context_.disk.Note(status);
    if (!status.ok()) {
      const MutexLock lock(&context_.tables.mutex);
      context_.tables.unsettled_jobs.push_back(job.job_id);
      continue;
    }
    if (job.phase == JobPhase::kFailed) {
      const std::string text = absl::StrCat("job ", job.job_id, " failed: ", job.failure);
      context_.options.warns_of_failed_jobs ? LogWarning(text) : LogInfo(text);
    } else {
      LogInfo(absl::StrCat("job ", job.job_id,
                           job.phase == JobPhase::kSucceeded ? " succeeded" : " was cancelled"));
    }
    context_.journal.Note(
        {.job_id = job.job_id, .what = WordOfEnd(job.phase), .text = job.failure});
    // A failed job keeps its parts for another try (LimitKeptParts).
    const bool keeps_parts = job.phase == JobPhase::kFailed && !IsPilot(job.job_id);
    for (const FrameId& frame : job.frames) {
      if (keeps_parts) continue;
      context_.disk.Note(context_.store.RemoveFrameParts(frame));
      context_.previews.RemoveFrom(frame, 0);
    }
    EraseOpenFrames(context_, job.job_id);
  }
  if (ended.empty()) return;
  context_.signals.Changed();
  context_.signals.JobsEnded(ended.size());
}

void JobEnds::SaveFailures() {
  const MutexLock settling(&context_.settle_mutex);
  SaveNewFailures(context_);
  SaveNewQuarantines(context_).IgnoreError();  // The disk's state is noted.
}

absl::Status JobEnds::SetWarning(uint64_t job_id, const std::string& text) {
  LogWarning(absl::StrCat("job ", job_id, ": ", text));
  absl::Status written = context_.store.SetWarning(job_id, text);
  context_.disk.Note(written);
  const MutexLock lock(&context_.tables.mutex);
  context_.tables.accounts[job_id].warning = text;
  return written;
}

void JobEnds::LimitKeptParts() {
  // No frame may be reopened meanwhile: its parts would be removed.
  const MutexLock settling(&context_.settle_mutex);
  while (context_.store.PartsBytes() > context_.options.kept_parts_bytes_max) {
    const absl::StatusOr<std::optional<FrameId>> oldest = context_.store.OldestDeliveredWithParts();
    context_.disk.Note(oldest.status());
    if (!oldest.ok() || !oldest->has_value()) return;
    const absl::Status removed = context_.store.RemoveFrameParts(**oldest);
    context_.disk.Note(removed);
    if (!removed.ok()) return;
  }
}

}  // namespace sheaf::coordinator
