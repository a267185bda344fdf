// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of JobLifecycle that continues ended jobs, to refine them, to remake images or to retry
// failed work; and that gives up work.
#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "coordinator/core/job/job_check.h"
#include "coordinator/service/farm/jobs/job_lifecycle.h"

namespace sheaf::coordinator {
namespace {

bool DependsOnTime(const StopRule& rule) {
  return rule.time_max != absl::InfiniteDuration() || rule.cpu_max != absl::InfiniteDuration();
}

// The frame under a new rule. None if nothing is left to render.
std::optional<JobStore::ReopenedFrame> Refined(const FrameSpec& old, const Refinement& refinement,
                                               std::vector<RoundRecord> rounds) {
  JobStore::ReopenedFrame frame{old, std::move(rounds)};
  frame.spec.stop = refinement.stop;
  if (refinement.samples != 0) frame.spec.settings.samples = refinement.samples;
  const uint64_t samples = frame.spec.settings.samples;
  if (!old.stop.IsActive()) {
    frame.spec.stop.first_round_samples = old.settings.samples;
    if (samples <= old.settings.samples) return std::nullopt;
    if (frame.spec.stop.IsActive()) frame.rounds.clear();  // Points decide nothing.
    return frame;
  }
  frame.spec.stop.first_round_samples = old.stop.first_round_samples;
  if (DependsOnTime(frame.spec.stop)) {
    frame.rounds.pop_back();  // Its end is decided again.
  } else if (!ReplayRounds(frame.spec.stop, samples, &frame.rounds)) {
    return std::nullopt;
  }
  return frame;
}

// Whether an earlier call has begun it.
bool IsBeingRefined(const JobRecord& job, const Refinement& refinement) {
  if (job.phase != JobPhase::kLive) return false;
  return std::any_of(job.frames.begin(), job.frames.end(), [&](const FrameRecord& frame) {
    StopRule rule = refinement.stop;
    rule.first_round_samples = frame.stop().first_round_samples;
    return frame.stop() == rule &&
           (refinement.samples == 0 || frame.settings().samples == refinement.samples);
  });
}

// Whether the frame has ended without an image.
bool HasEnded(const FrameRecord& frame) {
  return frame.phase == FrameRecord::Phase::kIncomplete ||
         frame.phase == FrameRecord::Phase::kClosed;
}

std::string WorkName(std::optional<int32_t> frame, std::optional<uint32_t> task) {
  return absl::StrCat(frame ? absl::StrCat(", frame ", *frame) : "",
                      task ? absl::StrCat(", task ", *task) : "");
}

}  // namespace

absl::Status RequireSucceeded(const JobRecord& job) {
  if (job.phase == JobPhase::kSucceeded) return absl::OkStatus();
  const char* const why = job.Paused()                   ? " is paused and not finished yet"
                          : job.phase == JobPhase::kLive ? " is not finished yet"
                                                         : " did not succeed";
  return absl::FailedPreconditionError(
      absl::StrCat("jobs/", job.spec.job_id, why, "; only a job that succeeded can be refined"));
}

absl::Status JobLifecycle::CheckRefinement(const JobRecord& job,
                                           const Refinement& refinement) const {
  if (absl::Status s = RequireSucceeded(job); !s.ok()) return s;
  const std::string name = absl::StrCat("jobs/", job.spec.job_id);
  if (!refinement.stop.IsActive() && refinement.samples == 0) {
    return absl::InvalidArgumentError(
        "a refinement needs a target error, a time, a budget or a number of samples");
  }
  for (const FrameRecord& frame : job.frames) {
    if (refinement.samples > options_.limits.samples_max) {
      return absl::InvalidArgumentError(absl::StrCat(
          refinement.samples, " samples are more than the limit of ", options_.limits.samples_max));
    }
    const uint64_t samples = frame.settings().samples;
    if (frame.stop().IsActive()) {
      if (refinement.stop.IsActive()) continue;
      return absl::InvalidArgumentError(
          absl::StrCat(name,
                       " was sampled adaptively; refine it by an error, a time or a budget, not by "
                       "a number of samples alone"));
    }
    if (refinement.samples != 0 && refinement.samples < samples) {
      return absl::InvalidArgumentError(
          absl::StrCat(name, " already has ", samples, " samples; choose more than ", samples));
    }
  }
  return absl::OkStatus();
}

absl::Status JobLifecycle::RefineJob(uint64_t job_id, const JobArguments& arguments) {
  const Refinement& refinement = arguments.refinement;
  const MutexLock settling(&settle_mutex_);  // No end or new beginning is written meanwhile.
  StoredJob job;
  bool parts_removed = false;
  {
    const MutexLock lock(&tables_.mutex);
    const absl::StatusOr<const JobRecord*> found = tables_.FindJob(job_id);
    if (!found.ok()) return found.status();
    parts_removed = tables_.accounts.at(job_id).parts_removed_time != absl::InfiniteFuture();
    if (IsBeingRefined(**found, refinement)) return absl::OkStatus();
    if (absl::Status s = CheckRefinement(**found, refinement); !s.ok()) return s;
    job = StoredJobOf(**found);
  }
  absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> rounds = RoundsOf(job_id);
  if (!rounds.ok()) return rounds.status();
  std::set<int32_t> with_parts;
  if (parts_removed) {
    const absl::StatusOr<std::vector<PartRow>> rows = store_.ListParts(job_id);
    if (!rows.ok()) return rows.status();
    for (const PartRow& row : *rows) with_parts.insert(row.key.frame.frame_number);
  }
  std::vector<JobStore::ReopenedFrame> reopened;
  for (FrameSpec& frame : job.spec.frames) {
    std::optional<JobStore::ReopenedFrame> refined =
        Refined(frame, refinement, std::move((*rounds)[frame.frame_number]));
    if (!refined) continue;
    const bool has_parts = !parts_removed || with_parts.contains(frame.frame_number);
    if (!has_parts) ContinueFromImage(job.spec, &*refined);
    frame = refined->spec;
    reopened.push_back(*std::move(refined));
  }
  if (reopened.empty()) return absl::OkStatus();  // It is good enough.
  if (absl::Status s = CheckJobSpec(job.spec, options_.limits); !s.ok()) return s;
  {
    const MutexLock lock(&tables_.mutex);
    if (absl::Status s = tables_.scheduler.CheckOwner(job.spec); !s.ok()) return s;
  }
  return ReopenFrames(std::move(job), reopened);
}

void JobLifecycle::ContinueFromImage(const JobSpec& job, JobStore::ReopenedFrame* frame) const {
  const FrameId id{job.job_id, frame->spec.frame_number};
  const absl::StatusOr<std::string> path = store_.OutputPath(id);
  absl::Status continued = path.status();
  if (path.ok()) continued = resumed_.ContinueFrom(*path, job.partition, &frame->spec);
  if (continued.ok()) {
    frame->rounds.clear();  // The image's samples become the first round.
    return;
  }
  LogInfo(absl::StrCat(
      "job ", id.job_id, ": frame ", id.frame_number,
      " is rendered again, because its parts were removed, and: ", continued.message()));
}

absl::Status JobLifecycle::RemakeFrames(uint64_t job_id, const std::set<int32_t>& numbers) {
  const MutexLock settling(&settle_mutex_);
  StoredJob job;
  {
    const MutexLock lock(&tables_.mutex);
    const absl::StatusOr<const JobRecord*> found = tables_.FindJob(job_id);
    if (!found.ok()) return found.status();
    if ((*found)->phase != JobPhase::kSucceeded) return absl::OkStatus();  // Refined meanwhile.
    job = StoredJobOf(**found);
  }
  absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> rounds = RoundsOf(job_id);
  if (!rounds.ok()) return rounds.status();
  std::vector<JobStore::ReopenedFrame> reopened;
  for (const FrameSpec& frame : job.spec.frames) {
    if (!numbers.contains(frame.frame_number)) continue;
    reopened.push_back({frame, std::move((*rounds)[frame.frame_number])});
  }
  return ReopenFrames(std::move(job), reopened);
}

StoredJob JobLifecycle::StoredJobOf(const JobRecord& record) const {
  StoredJob job;
  job.spec = record.spec;
  job.failures = record.failures;
  for (const FrameRecord& frame : record.frames) job.spec.frames.push_back(frame.Spec());
  job.create_time = tables_.accounts.at(record.spec.job_id).create_time;
  return job;
}

absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> JobLifecycle::RoundsOf(
    uint64_t job_id) const {
  absl::StatusOr<std::vector<StoredRound>> stored = store_.LoadRounds(job_id, /*with_cells=*/true);
  if (!stored.ok()) return stored.status();
  std::map<int32_t, std::vector<RoundRecord>> rounds;
  for (StoredRound& round : *stored) rounds[round.frame_number].push_back(std::move(round.record));
  return rounds;
}

absl::StatusOr<JobStore::LoadedParts> JobLifecycle::LoadPartsOf(
    uint64_t job_id, const std::vector<PartRow>& without) {
  PartKeys left = removals_.Left();
  for (const PartRow& row : without) left.insert(row.key);
  absl::StatusOr<JobStore::LoadedParts> parts = store_.LoadParts(job_id);
  if (!parts.ok()) return parts;
  const auto is_left = [&left](const PartRow& row) { return left.contains(row.key); };
  std::erase_if(parts->rows, is_left);
  std::erase_if(parts->lost, is_left);
  removals_.Remove(parts->lost);
  return parts;
}

void JobLifecycle::TakeOut(uint64_t job_id) {
  if (tables_.scheduler.jobs().at(job_id).phase == JobPhase::kLive) {
    // It ends only for the scheduler, and restarts at once.
    tables_.scheduler.RestoreEnded(job_id, JobPhase::kCancelled, "");
    tables_.open_frames.erase(tables_.open_frames.lower_bound({job_id, INT32_MIN}),
                              tables_.open_frames.upper_bound({job_id, INT32_MAX}));
  }
  tables_.scheduler.RemoveJob(job_id);
  // Cancels a pending write of its end, which would remove its parts.
  std::erase(tables_.unsettled_jobs, job_id);
}

absl::Status JobLifecycle::ReopenFrames(StoredJob job,
                                        const std::vector<JobStore::ReopenedFrame>& reopened,
                                        const std::vector<PartRow>& false_parts,
                                        bool may_have_failed) {
  const uint64_t job_id = job.spec.job_id;
  std::set<int32_t> undelivered;
  for (const JobStore::ReopenedFrame& frame : reopened) {
    undelivered.insert(frame.spec.frame_number);
  }
  {
    const MutexLock lock(&tables_.mutex);
    for (const FrameRecord& frame : tables_.scheduler.jobs().at(job_id).frames) {
      if (frame.phase != FrameRecord::Phase::kDelivered) undelivered.insert(frame.number());
    }
  }
  std::vector<FrameSpec> specs;
  for (const FrameSpec& frame : job.spec.frames) {
    if (undelivered.contains(frame.frame_number)) specs.push_back(frame);
  }
  const absl::StatusOr<ResumedCounts> resumed = resumed_.Count(specs, job.spec.partition);
  if (!resumed.ok()) return resumed.status();
  if (absl::Status saved = SaveNewTroubles(); !saved.ok()) return saved;
  absl::StatusOr<std::vector<TaskTrouble>> troubles = store_.LoadTroubles(job_id);
  if (!troubles.ok()) return troubles.status();
  job.troubles = *std::move(troubles);
  ++reopen_count_;
  absl::Status written = store_.ReopenJob(job_id, reopened);
  disk_.Note(written);
  if (!written.ok()) return written;
  const absl::StatusOr<JobStore::LoadedParts> parts = LoadPartsOf(job_id, false_parts);
  if (!parts.ok()) return parts.status();
  absl::StatusOr<std::vector<StoredRound>> rounds = store_.LoadRounds(job_id, /*with_cells=*/true);
  if (!rounds.ok()) return rounds.status();
  // Only after the frames are no longer delivered: after a stop in between they are found again.
  // And after all steps that may fail, so that a retry finds them, too.
  RemoveFalse(false_parts);
  for (const JobStore::ReopenedFrame& frame : reopened) {
    const auto kept = static_cast<int32_t>(frame.rounds.size());
    previews_.RemoveFrom({job_id, frame.spec.frame_number}, kept);
  }
  const MutexLock lock(&tables_.mutex);
  const JobRecord& record = tables_.scheduler.jobs().at(job_id);
  // It ended meanwhile; its end will be stored soon.
  const bool has_failed = record.phase == JobPhase::kFailed && !may_have_failed;
  if (has_failed || record.phase == JobPhase::kCancelled) return absl::OkStatus();
  JobAccount& account = tables_.accounts.at(job_id);
  const SteadyTime until = std::min(SteadyTime::Now(), account.ended);
  account.job_wall_before = tables_.WallOfJob(record, until);
  std::map<int32_t, absl::Duration> wall_before;
  for (const FrameRecord& frame : record.frames) {
    if (frame.phase == FrameRecord::Phase::kDelivered) continue;
    wall_before[frame.number()] = tables_.WallOf({job_id, frame.number()}, until);
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
  TakeOut(job_id);
  LogInfo(absl::StrCat("job ", job_id, ": continues, ", reopened.size(),
                       reopened.size() == 1 ? " frame" : " frames"));
  RestoreJob(job, *std::move(rounds), &*parts, *resumed);
  account.wall_before = std::move(wall_before);
  signals_.Changed();
  return absl::OkStatus();
}

absl::Status JobLifecycle::RetryTasks(uint64_t job_id, const JobArguments& arguments) {
  const std::optional<int32_t> frame = arguments.frame;
  const std::optional<uint32_t> task = arguments.task;
  const MutexLock settling(&settle_mutex_);
  bool reopens = false;
  {
    const MutexLock lock(&tables_.mutex);
    const absl::StatusOr<const JobRecord*> found = tables_.FindJob(job_id);
    if (!found.ok()) return found.status();
    const JobRecord& job = **found;
    if (job.phase == JobPhase::kSucceeded || job.phase == JobPhase::kCancelled) {
      return absl::FailedPreconditionError(absl::StrCat(
          "jobs/", job_id, job.phase == JobPhase::kSucceeded ? " has succeeded" : " was cancelled",
          "; only a running or failed job can be retried"));
    }
    if (frame && !job.FindIndex(*frame)) {
      return absl::NotFoundError(absl::StrCat("jobs/", job_id, " has no frame ", *frame));
    }
    for (const FrameRecord& record : job.frames) {
      reopens |= (!frame || record.number() == *frame) && HasEnded(record);
    }
    if (job.phase == JobPhase::kFailed) {
      if (!reopens) {
        return absl::FailedPreconditionError(
            absl::StrCat("jobs/", job_id, " has failed, but not by frame ", frame.value_or(0)));
      }
      JobSpec spec = job.spec;
      for (const FrameRecord& record : job.frames) spec.frames.push_back(record.Spec());
      absl::Status allowed = tables_.scheduler.CheckOwner(spec);
      if (!allowed.ok()) return allowed;
    }
    tables_.scheduler.Retry(job_id, frame, task);
    tables_.NoteEndedJobs();
  }
  if (absl::Status saved = SaveNewTroubles(); !saved.ok()) return saved;
  if (reopens) {
    absl::Status reopened = ReopenUndelivered(job_id, frame, task);
    if (!reopened.ok()) return reopened;
  }
  LogInfo(absl::StrCat("job ", job_id, WorkName(frame, task), ": is tried again"));
  signals_.Changed();
  return absl::OkStatus();
}

absl::Status JobLifecycle::ReopenUndelivered(uint64_t job_id, std::optional<int32_t> frame,
                                             std::optional<uint32_t> task) {
  StoredJob job;
  std::vector<int32_t> numbers;
  {
    const MutexLock lock(&tables_.mutex);
    const JobRecord& record = tables_.scheduler.jobs().at(job_id);
    job = StoredJobOf(record);
    for (const FrameRecord& of_job : record.frames) {
      if (HasEnded(of_job)) numbers.push_back(of_job.number());
    }
  }
  absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> rounds = RoundsOf(job_id);
  if (!rounds.ok()) return rounds.status();
  std::vector<JobStore::ReopenedFrame> reopened;
  for (const FrameSpec& spec : job.spec.frames) {
    if (std::find(numbers.begin(), numbers.end(), spec.frame_number) == numbers.end()) continue;
    reopened.push_back({spec, std::move((*rounds)[spec.frame_number])});
  }
  absl::Status done = ReopenFrames(std::move(job), reopened, /*false_parts=*/{},
                                   /*may_have_failed=*/true);
  if (!done.ok()) return done;
  // Losses while loading are restored from the list of failures, which stays.
  const MutexLock lock(&tables_.mutex);
  tables_.scheduler.Retry(job_id, frame, task);
  tables_.NoteEndedJobs();
  return absl::OkStatus();
}

absl::Status JobLifecycle::KillTasks(uint64_t job_id, const JobArguments& arguments) {
  if (!arguments.frame) return absl::InvalidArgumentError("a frame to kill is missing");
  const FrameId id{job_id, *arguments.frame};
  const std::optional<uint32_t> task = arguments.task;
  const std::string why = absl::StrCat("killed by ", arguments.user);
  {
    const MutexLock settling(&settle_mutex_);  // No new beginning is written meanwhile.
    {
      const MutexLock lock(&tables_.mutex);
      const absl::StatusOr<const JobRecord*> found = tables_.FindJob(id.job_id);
      if (!found.ok()) return found.status();
      absl::Status killed = tables_.scheduler.Kill(id, task, why);
      tables_.NoteEndedJobs();
      if (!killed.ok()) return killed;
    }
    if (absl::Status saved = SaveNewTroubles(); !saved.ok()) return saved;
  }
  LogInfo(absl::StrCat("job ", id.job_id, WorkName(id.frame_number, task), ": ", why));
  SettleEnded();
  signals_.Changed();
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
