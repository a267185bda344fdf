// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/jobs/job_reopening.h"

#include <algorithm>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "coordinator/service/farm/jobs/job_ends.h"
#include "coordinator/service/farm/jobs/job_restore.h"

namespace sheaf::coordinator {
namespace {

void TakeOut(JobContext& context, uint64_t job_id)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.tables.mutex) {
  if (context.tables.scheduler.jobs().at(job_id).phase == JobPhase::kLive) {
    // It ends only for the scheduler, and restarts at once.
    context.tables.scheduler.RestoreEnded(job_id, JobPhase::kCancelled, "");
    context.tables.open_frames.erase(context.tables.open_frames.lower_bound({job_id, INT32_MIN}),
                                     context.tables.open_frames.upper_bound({job_id, INT32_MAX}));
  }
  context.tables.scheduler.RemoveJob(job_id);
  // Cancels a pending write of its end, which would remove its parts.
  std::erase(context.tables.unsettled_jobs, job_id);
}

absl::Status StoreReopened(JobContext& context, uint64_t job_id, bool has_ended,
                           const std::vector<JobStore::ReopenedFrame>& reopened) {
  absl::Status written = absl::OkStatus();
  // The end of a job ends its pause, but may not be stored yet, and is not once the job continues.
  if (has_ended) written = context.store.ChangeJob(job_id, {.paused = false});
  if (written.ok()) written = context.store.ReopenJob(job_id, reopened);
  context.disk.Note(written);
  return written;
}

}  // namespace

std::string NameOfWork(std::optional<int32_t> frame, std::optional<uint32_t> task) {
  return absl::StrCat(frame ? absl::StrCat(", frame ", *frame) : "",
                      task ? absl::StrCat(", task ", *task) : "");
}

StoredJob StoredJobOf(JobContext& context, const JobRecord& record) {
  StoredJob job;
  job.spec = record.spec;
  job.failures = record.failures;
  for (const FrameRecord& frame : record.frames) job.spec.frames.push_back(frame.Spec());
  job.create_time = context.tables.accounts.at(record.spec.job_id).create_time;
  return job;
}

absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> RoundsOf(JobContext& context,
                                                                     uint64_t job_id) {
  absl::StatusOr<std::vector<StoredRound>> stored =
      context.store.LoadRounds(job_id, /*with_cells=*/true);
  if (!stored.ok()) return stored.status();
  std::map<int32_t, std::vector<RoundRecord>> rounds;
  for (StoredRound& round : *stored) rounds[round.frame_number].push_back(std::move(round.record));
  return rounds;
}

void RemoveFalse(JobContext& context, const std::vector<PartRow>& parts) {
  context.removals.Remove(parts);
  for (const PartRow& part : parts) {
    context.store.NoteUsage({part.key.frame.job_id},
                            {.lost_count = 1, .lost_cpu_duration = part.cost.cpu_duration});
  }
  const MutexLock lock(&context.tables.mutex);
  context.tables.scheduler.counters().parts_revoked += parts.size();
}

absl::Status ReopenFrames(JobContext& context, StoredJob job,
                          const std::vector<JobStore::ReopenedFrame>& reopened,
                          const std::vector<PartRow>& false_parts, bool may_have_failed) {
  const uint64_t job_id = job.spec.job_id;
  std::set<int32_t> undelivered;
  for (const JobStore::ReopenedFrame& frame : reopened) {
    undelivered.insert(frame.spec.frame_number);
  }
  bool has_ended = false;
  {
    const MutexLock lock(&context.tables.mutex);
    const JobRecord& record = context.tables.scheduler.jobs().at(job_id);
    has_ended = record.phase != JobPhase::kLive;
    for (const FrameRecord& frame : record.frames) {
      if (frame.phase != FrameRecord::Phase::kDelivered) undelivered.insert(frame.number());
    }
  }
  std::vector<FrameSpec> specs;
  for (const FrameSpec& frame : job.spec.frames) {
    if (undelivered.contains(frame.frame_number)) specs.push_back(frame);
  }
  const absl::StatusOr<ResumedCounts> resumed = context.resumed.Count(specs, job.spec.partition);
  if (!resumed.ok()) return resumed.status();
  if (absl::Status saved = SaveNewTroubles(context); !saved.ok()) return saved;
  absl::StatusOr<std::vector<TaskTrouble>> troubles = context.store.LoadTroubles(job_id);
  if (!troubles.ok()) return troubles.status();
  job.troubles = *std::move(troubles);
  ++context.reopen_count;
  absl::Status written = StoreReopened(context, job_id, has_ended, reopened);
  if (!written.ok()) return written;
  const absl::StatusOr<JobStore::LoadedParts> parts = LoadPartsOf(context, job_id, false_parts);
  if (!parts.ok()) return parts.status();
  absl::StatusOr<std::vector<StoredRound>> rounds =
      context.store.LoadRounds(job_id, /*with_cells=*/true);
  if (!rounds.ok()) return rounds.status();
  // Only after the frames are no longer delivered: after a stop in between they are found again.
  // And after all steps that may fail, so that a retry finds them, too.
  RemoveFalse(context, false_parts);
  for (const JobStore::ReopenedFrame& frame : reopened) {
    const auto kept = static_cast<int32_t>(frame.rounds.size());
    context.previews.RemoveFrom({job_id, frame.spec.frame_number}, kept);
  }
  const MutexLock lock(&context.tables.mutex);
  const JobRecord& record = context.tables.scheduler.jobs().at(job_id);
  // It ended meanwhile; its end will be stored soon.
  const bool has_failed = record.phase == JobPhase::kFailed && !may_have_failed;
  if (has_failed || record.phase == JobPhase::kCancelled) return absl::OkStatus();
  JobAccount& account = context.tables.accounts.at(job_id);
  const SteadyTime until = std::min(SteadyTime::Now(), account.ended);
  account.job_wall_before = context.tables.WallOfJob(record, until);
  std::map<int32_t, absl::Duration> wall_before;
  for (const FrameRecord& frame : record.frames) {
    if (frame.phase == FrameRecord::Phase::kDelivered) continue;
    wall_before[frame.number()] = context.tables.WallOf({job_id, frame.number()}, until);
  }
  account.end_time = absl::InfiniteFuture();
  if (reopened.size() == record.frames.size()) {
    account.parts_removed_time = absl::InfiniteFuture();
  }
  account.ended = SteadyTime::InfiniteFuture();
  for (const auto& [number, delivered] : account.delivered) {
    if (undelivered.contains(number)) {
      wall_before[number] = delivered.wall_duration;
    } else {
      job.delivered.push_back({number, delivered});
    }
  }
  for (const JobStore::ReopenedFrame& frame : reopened) {
    if (frame.is_correction) ++account.corrections[frame.spec.frame_number];
  }
  account.delivered.clear();
  account.rounds.clear();
  job.paused = record.Paused();
  TakeOut(context, job_id);
  LogInfo(absl::StrCat("job ", job_id, ": continues, ", reopened.size(),
                       reopened.size() == 1 ? " frame" : " frames"));
  RestoreJob(context, job, *std::move(rounds), &*parts, *resumed);
  account.wall_before = std::move(wall_before);
  context.signals.Changed();
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
