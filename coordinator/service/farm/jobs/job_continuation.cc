// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/jobs/job_continuation.h"

#include <algorithm>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/scene/settings/sample_bound.h"
#include "coordinator/core/job/job_approval.h"
#include "coordinator/core/job/job_check.h"
#include "coordinator/service/farm/jobs/job_ends.h"
#include "coordinator/service/farm/jobs/job_reopening.h"

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

absl::Status RequireNotGivenUp(const JobRecord& job) {
  if (job.phase == JobPhase::kLive || job.phase == JobPhase::kSucceeded) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(
      "jobs/", job.spec.job_id, job.phase == JobPhase::kFailed ? " has failed" : " was cancelled",
      job.phase == JobPhase::kFailed ? "; retry it first, by sheaf retry" : ""));
}

absl::Status RequireSucceeded(const JobRecord& job) {
  if (job.phase == JobPhase::kSucceeded) return absl::OkStatus();
  const char* const why = job.Paused()                   ? " is paused and not finished yet"
                          : job.phase == JobPhase::kLive ? " is not finished yet"
                                                         : " did not succeed";
  return absl::FailedPreconditionError(
      absl::StrCat("jobs/", job.spec.job_id, why, "; only a job that succeeded can be refined"));
}

absl::Status JobContinuation::CheckRefinement(const JobRecord& job,
                                              const Refinement& refinement) const {
  if (absl::Status s = RequireSucceeded(job); !s.ok()) return s;
  const std::string name = absl::StrCat("jobs/", job.spec.job_id);
  if (!refinement.stop.IsActive() && refinement.samples == 0) {
    return absl::InvalidArgumentError(
        "a refinement needs a target error, a time, a budget or a number of samples");
  }
  for (const FrameRecord& frame : job.frames) {
    if (refinement.samples > context_.options.limits.samples_max) {
      return absl::InvalidArgumentError(absl::StrCat(refinement.samples,
                                                     " samples are more than the limit of ",
                                                     context_.options.limits.samples_max));
    }
    const SampleBound bound = SampleBoundOf(frame.settings());
    if (refinement.stop.certified && !bound.most.has_value()) {
      return absl::InvalidArgumentError(absl::StrCat(name, ": the error of frame ", frame.number(),
                                                     " cannot be certified: ", bound.reason));
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

absl::Status JobContinuation::RefineJob(uint64_t job_id, const JobArguments& arguments) {
  const Refinement& refinement = arguments.refinement;
  const MutexLock settling(
      &context_.settle_mutex);  // No end or new beginning is written meanwhile.
  StoredJob job;
  bool parts_removed = false;
  {
    const MutexLock lock(&context_.tables.mutex);
    const absl::StatusOr<const JobRecord*> found = context_.tables.FindJob(job_id);
    if (!found.ok()) return found.status();
    parts_removed =
        context_.tables.accounts.at(job_id).parts_removed_time != absl::InfiniteFuture();
    if (IsBeingRefined(**found, refinement)) return absl::OkStatus();
    if (absl::Status s = CheckRefinement(**found, refinement); !s.ok()) return s;
    job = StoredJobOf(context_, **found);
  }
  absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> rounds = RoundsOf(context_, job_id);
  if (!rounds.ok()) return rounds.status();
  std::set<int32_t> with_parts;
  if (parts_removed) {
    const absl::StatusOr<std::vector<PartRow>> rows = context_.store.ListParts(job_id);
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
  if (absl::Status s = CheckJobSpec(job.spec, context_.options.limits); !s.ok()) return s;
  {
    const MutexLock lock(&context_.tables.mutex);
    if (absl::Status s = context_.tables.scheduler.CheckOwner(job.spec); !s.ok()) return s;
  }
  return ReopenFrames(context_, std::move(job), reopened);
}

void JobContinuation::ContinueFromImage(const JobSpec& job, JobStore::ReopenedFrame* frame) const {
  const FrameId id{job.job_id, frame->spec.frame_number};
  const absl::StatusOr<std::string> path = context_.store.OutputPath(id);
  absl::Status continued = path.status();
  if (path.ok()) continued = context_.resumed.ContinueFrom(*path, job.partition, &frame->spec);
  if (continued.ok()) {
    frame->rounds.clear();  // The image's samples become the first round.
    return;
  }
  LogInfo(absl::StrCat(
      "job ", id.job_id, ": frame ", id.frame_number,
      " is rendered again, because its parts were removed, and: ", continued.message()));
}

absl::Status JobContinuation::ApproveFrames(uint64_t job_id, const JobArguments& arguments) {
  const MutexLock settling(&context_.settle_mutex);
  StoredJob job;
  std::set<int32_t> chosen;
  {
    const MutexLock lock(&context_.tables.mutex);
    const absl::StatusOr<const JobRecord*> found = context_.tables.FindJob(job_id);
    if (!found.ok()) return found.status();
    if (absl::Status there = RequireNotGivenUp(**found); !there.ok()) return there;
    absl::StatusOr<std::set<int32_t>> waiting = ChooseWaiting(**found, arguments.frames);
    if (!waiting.ok()) return waiting.status();
    chosen = *std::move(waiting);
    job = StoredJobOf(context_, **found);
  }
  if (chosen.empty()) return absl::OkStatus();  // An earlier call has done it.
  absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> rounds = RoundsOf(context_, job_id);
  if (!rounds.ok()) return rounds.status();
  std::vector<JobStore::ReopenedFrame> reopened;
  for (FrameSpec& frame : job.spec.frames) {
    if (!chosen.contains(frame.frame_number)) continue;
    FrameApproval& approval = job.spec.approvals.at(frame.frame_number);
    approval.approved = true;
    frame.settings.samples = approval.samples;
    reopened.push_back({frame, std::move((*rounds)[frame.frame_number])});
  }
  if (absl::Status status = ReopenFrames(context_, std::move(job), reopened); !status.ok())
    return status;
  LogInfo(absl::StrCat("job ", job_id, ": ", chosen.size(),
                       chosen.size() == 1 ? " frame is" : " frames are", " approved"));
  return absl::OkStatus();
}

absl::Status JobContinuation::RemakeFrames(uint64_t job_id, const std::set<int32_t>& numbers) {
  const MutexLock settling(&context_.settle_mutex);
  StoredJob job;
  {
    const MutexLock lock(&context_.tables.mutex);
    const absl::StatusOr<const JobRecord*> found = context_.tables.FindJob(job_id);
    if (!found.ok()) return found.status();
    if ((*found)->phase != JobPhase::kSucceeded) return absl::OkStatus();  // Refined meanwhile.
    job = StoredJobOf(context_, **found);
  }
  absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> rounds = RoundsOf(context_, job_id);
  if (!rounds.ok()) return rounds.status();
  std::vector<JobStore::ReopenedFrame> reopened;
  for (const FrameSpec& frame : job.spec.frames) {
    if (!numbers.contains(frame.frame_number)) continue;
    reopened.push_back({frame, std::move((*rounds)[frame.frame_number])});
  }
  return ReopenFrames(context_, std::move(job), reopened);
}

absl::Status JobContinuation::RetryTasks(uint64_t job_id, const JobArguments& arguments) {
  const std::optional<int32_t> frame = arguments.frame;
  const std::optional<uint32_t> task = arguments.task;
  const MutexLock settling(&context_.settle_mutex);
  bool reopens = false;
  {
    const MutexLock lock(&context_.tables.mutex);
    const absl::StatusOr<const JobRecord*> found = context_.tables.FindJob(job_id);
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
      absl::Status allowed = context_.tables.scheduler.CheckOwner(spec);
      if (!allowed.ok()) return allowed;
    }
    context_.tables.scheduler.Retry(job_id, frame, task);
    context_.tables.NoteEndedJobs();
  }
  if (absl::Status saved = SaveNewTroubles(context_); !saved.ok()) return saved;
  if (reopens) {
    absl::Status reopened = ReopenUndelivered(job_id, frame, task);
    if (!reopened.ok()) return reopened;
  }
  LogInfo(absl::StrCat("job ", job_id, NameOfWork(frame, task), ": is tried again"));
  context_.signals.Changed();
  return absl::OkStatus();
}

absl::Status JobContinuation::ReopenUndelivered(uint64_t job_id, std::optional<int32_t> frame,
                                                std::optional<uint32_t> task) {
  StoredJob job;
  std::vector<int32_t> numbers;
  {
    const MutexLock lock(&context_.tables.mutex);
    const JobRecord& record = context_.tables.scheduler.jobs().at(job_id);
    job = StoredJobOf(context_, record);
    for (const FrameRecord& of_job : record.frames) {
      if (HasEnded(of_job)) numbers.push_back(of_job.number());
    }
  }
  absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> rounds = RoundsOf(context_, job_id);
  if (!rounds.ok()) return rounds.status();
  std::vector<JobStore::ReopenedFrame> reopened;
  for (const FrameSpec& spec : job.spec.frames) {
    if (std::find(numbers.begin(), numbers.end(), spec.frame_number) == numbers.end()) continue;
    reopened.push_back({spec, std::move((*rounds)[spec.frame_number])});
  }
  absl::Status done = ReopenFrames(context_, std::move(job), reopened, /*false_parts=*/{},
                                   /*may_have_failed=*/true);
  if (!done.ok()) return done;
  // Losses while loading are restored from the list of failures, which stays.
  const MutexLock lock(&context_.tables.mutex);
  context_.tables.scheduler.Retry(job_id, frame, task);
  context_.tables.NoteEndedJobs();
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
