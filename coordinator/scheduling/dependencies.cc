// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/dependencies.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "coordinator/core/job/job_approval.h"
#include "coordinator/scheduling/scheduler.h"

namespace sheaf::coordinator {
namespace {

std::string NameOf(uint64_t job_id) { return absl::StrCat("jobs/", job_id); }

// Why a job ended without delivery, or why it is not delivered.
std::string WhyBroken(const JobRecords& jobs, uint64_t job_id) {
  const auto job = jobs.find(job_id);
  if (job == jobs.end()) return "no longer exists";
  if (job->second.phase == JobPhase::kFailed) return "has failed";
  if (job->second.phase == JobPhase::kCancelled) return "was cancelled";
  return "has incomplete frames";
}

// Tells a user how to resolve a broken dependency.
std::string Remedy(const JobRecords& jobs, const JobRecord& waiting, uint64_t job_id) {
  const auto job = jobs.find(job_id);
  const bool can_retry = job != jobs.end() && job->second.phase != JobPhase::kCancelled;
  const std::string name = NameOf(waiting.spec.job_id);
  return absl::StrCat(
      "sheaf release ", name, " starts this job anyway",
      can_retry ? absl::StrCat(", sheaf retry ", NameOf(job_id), " tries that ", "one again")
                : std::string(),
      ", sheaf cancel ", name, " ends this one");
}

std::string Frames(int count) { return absl::StrCat(count, count == 1 ? " frame" : " frames"); }

bool IsUndone(const FrameRecord& frame) {
  return frame.phase == FrameRecord::Phase::kPending || frame.phase == FrameRecord::Phase::kOpen;
}

// The frames of a job that wait for frames of another one, and an example: the first that waits in
// vain, or else the first.
struct WaitingFrames {
  int count = 0;
  const FrameRecord* frame = nullptr;
  const JobDependency* dependency = nullptr;
  bool is_broken = false;
};

WaitingFrames WaitingFramesOf(const JobRecords& jobs, const JobRecord& job) {
  WaitingFrames waiting;
  for (const FrameRecord& frame : job.frames) {
    if (!frame.blocked || !IsUndone(frame)) continue;
    ++waiting.count;
    for (const JobDependency& dependency : job.spec.dependencies) {
      if (!dependency.by_frame) continue;
      const DependencyState state = StateOf(jobs, dependency, frame.number());
      if (state == DependencyState::kDone) continue;
      const bool is_broken = state == DependencyState::kBroken;
      if (waiting.frame != nullptr && (waiting.is_broken || !is_broken)) continue;
      waiting.frame = &frame;
      waiting.dependency = &dependency;
      waiting.is_broken = is_broken;
    }
  }
  return waiting;
}

std::string WhyJobWaits(const JobRecords& jobs, const JobRecord& job) {
  const JobDependency* awaited = nullptr;
  for (const JobDependency& dependency : job.spec.dependencies) {
    if (dependency.by_frame) continue;
    const DependencyState state = StateOf(jobs, dependency, std::nullopt);
    if (state == DependencyState::kBroken) {
      return absl::StrCat(NameOf(dependency.job_id), ", for which this job waits, ",
                          WhyBroken(jobs, dependency.job_id), ": ",
                          Remedy(jobs, job, dependency.job_id));
    }
    if (state == DependencyState::kAwaited && awaited == nullptr) awaited = &dependency;
  }
  return awaited == nullptr ? "" : absl::StrCat("waiting for ", NameOf(awaited->job_id));
}

std::string WhyFramesWait(const JobRecords& jobs, const JobRecord& job) {
  const WaitingFrames waiting = WaitingFramesOf(jobs, job);
  if (waiting.frame == nullptr) return "";
  const uint64_t job_id = waiting.dependency->job_id;
  const int32_t number = waiting.frame->number();
  const std::string text = absl::StrCat("waiting for other jobs, with ", Frames(waiting.count),
                                        ": frame ", number, " for that of ", NameOf(job_id));
  if (!waiting.is_broken) return text;
  return absl::StrCat(text, ", which ", WhyBroken(jobs, job_id), ": ", Remedy(jobs, job, job_id));
}

}  // namespace

DependencyState StateOf(const JobRecords& jobs, const JobDependency& dependency,
                        std::optional<int32_t> frame_number) {
  if (dependency.released || dependency.removed) return DependencyState::kDone;
  const auto found = jobs.find(dependency.job_id);
  if (found == jobs.end()) return DependencyState::kBroken;
  const JobRecord& job = found->second;
  if (!frame_number) {
    if (job.phase == JobPhase::kSucceeded) return DependencyState::kDone;
    const bool goes_on = job.phase == JobPhase::kLive && job.incomplete_count == 0;
    return goes_on ? DependencyState::kAwaited : DependencyState::kBroken;
  }
  const std::optional<uint32_t> index = job.FindIndex(*frame_number);
  if (!index) return DependencyState::kBroken;
  const FrameRecord::Phase phase = job.frames[*index].phase;
  if (phase == FrameRecord::Phase::kDelivered && !IsUnapproved(job.spec, *frame_number)) {
    return DependencyState::kDone;
  }
  const bool goes_on = job.phase == JobPhase::kLive && phase != FrameRecord::Phase::kIncomplete;
  return goes_on ? DependencyState::kAwaited : DependencyState::kBroken;
}

DependencyState StateForAll(const JobRecords& jobs, const JobRecord& job,
                            const JobDependency& dependency) {
  if (!dependency.by_frame) return StateOf(jobs, dependency, std::nullopt);
  DependencyState worst = DependencyState::kDone;
  for (const FrameRecord& frame : job.frames) {
    worst = std::max(worst, StateOf(jobs, dependency, frame.number()));
  }
  return worst;
}

bool IsBlocked(const JobRecords& jobs, const JobRecord& job) {
  return std::ranges::any_of(job.spec.dependencies, [&](const JobDependency& dependency) {
    return !dependency.by_frame &&
           StateOf(jobs, dependency, std::nullopt) != DependencyState::kDone;
  });
}

bool IsBlocked(const JobRecords& jobs, const JobRecord& job, int32_t frame_number) {
  return std::ranges::any_of(job.spec.dependencies, [&](const JobDependency& dependency) {
    return dependency.by_frame && StateOf(jobs, dependency, frame_number) != DependencyState::kDone;
  });
}

std::string WhyHeld(const JobRecords& jobs, const JobRecord& job) {
  if (job.blocked) return WhyJobWaits(jobs, job);
  if (!job.pending.empty() || !job.ready.empty()) return "";
  std::string why;
  if (const int count = job.unapproved_count; count > 0) {
    const std::string name = NameOf(job.spec.job_id);
    why = absl::StrCat("waiting for approval: sheaf approve ", name, " has ", Frames(count),
                       " rendered to the end, sheaf cancel ", name, " rejects the job");
  }
  const std::string frames = WhyFramesWait(jobs, job);
  return absl::StrCat(why, why.empty() || frames.empty() ? "" : "; ", frames);
}

std::string WhyFrameWaits(const JobRecords& jobs, const JobRecord& job, const FrameRecord& frame) {
  if (job.phase != JobPhase::kLive) return "";
  const int32_t number = frame.number();
  if (frame.phase == FrameRecord::Phase::kDelivered) {
    if (!IsUnapproved(job.spec, number)) return "";
    return absl::StrCat("waits for approval with ", frame.settings().samples, " of ",
                        job.spec.approvals.at(number).samples, " samples: sheaf approve ",
                        NameOf(job.spec.job_id), " --frames ", number);
  }
  if (!frame.blocked || !IsUndone(frame)) return "";
  for (const JobDependency& dependency : job.spec.dependencies) {
    if (!dependency.by_frame) continue;
    const DependencyState state = StateOf(jobs, dependency, number);
    if (state == DependencyState::kDone) continue;
    return absl::StrCat("waits for frame ", number, " of ", NameOf(dependency.job_id),
                        state == DependencyState::kBroken
                            ? absl::StrCat(", which ", WhyBroken(jobs, dependency.job_id))
                            : std::string());
  }
  return "";
}

std::string DependencyText(const JobRecords& jobs, const JobRecord& job,
                           const JobDependency& dependency) {
  if (dependency.released) return "released";
  if (dependency.removed) return "done, and removed since";
  switch (StateForAll(jobs, job, dependency)) {
    case DependencyState::kDone:
      return "done";
    case DependencyState::kAwaited:
      return "waits";
    case DependencyState::kBroken:
      break;
  }
  return WhyBroken(jobs, dependency.job_id);
}

void Dependents::Add(const JobSpec& spec) {
  for (const JobDependency& dependency : spec.dependencies) {
    by_job_[dependency.job_id].insert(spec.job_id);
  }
}

void Dependents::Erase(const JobSpec& spec) {
  for (const JobDependency& dependency : spec.dependencies) {
    const auto found = by_job_.find(dependency.job_id);
    if (found == by_job_.end()) continue;
    found->second.erase(spec.job_id);
    if (found->second.empty()) by_job_.erase(found);
  }
}

const std::set<uint64_t>& Dependents::Of(uint64_t job_id) const {
  static const auto* const kNone = new std::set<uint64_t>;
  const auto found = by_job_.find(job_id);
  return found == by_job_.end() ? *kNone : found->second;
}

}  // namespace sheaf::coordinator
