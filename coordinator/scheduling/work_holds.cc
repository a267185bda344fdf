// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/work_holds.h"

#include <algorithm>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "coordinator/scheduling/frame_phases.h"

namespace sheaf::coordinator::scheduling {
namespace {

void JudgeFrame(WorkState& state, JobRecord* job, uint32_t index) {
  FrameRecord& frame = job->frames[index];
  const bool is_blocked = IsBlocked(state.jobs, *job, frame.number());
  if (frame.blocked == is_blocked) return;
  frame.blocked = is_blocked;
  UpdateReady(state, job, index);
}

}  // namespace

absl::Status CheckDependencies(const WorkState& state, const JobSpec& spec) {
  if (spec.dependencies.empty()) return absl::OkStatus();
  if (spec.pilot) return absl::InvalidArgumentError("dependencies: the pilot of a quote has none");
  if (spec.dependencies.size() > state.limits.job_dependencies_max) {
    return absl::InvalidArgumentError(
        absl::StrCat("dependencies: a job waits for ", state.limits.job_dependencies_max,
                     " others at most; let it wait for one that waits for the rest"));
  }
  std::set<uint64_t> named;
  for (const JobDependency& dependency : spec.dependencies) {
    const std::string name = absl::StrCat("jobs/", dependency.job_id);
    if (!named.insert(dependency.job_id).second) {
      return absl::InvalidArgumentError(absl::StrCat("dependencies: ", name, " is named twice"));
    }
    const auto job = state.jobs.find(dependency.job_id);
    if (job == state.jobs.end() || job->second.spec.pilot) {
      return absl::NotFoundError(
          absl::StrCat(name, ": there is no such job to wait for; sheaf list lists them"));
    }
    if (job->second.phase == JobPhase::kCancelled) {
      return absl::FailedPreconditionError(absl::StrCat(
          name, " was cancelled and will not be delivered; wait for ", "another job, or for none"));
    }
    if (!dependency.by_frame) continue;
    for (const FrameSpec& frame : spec.frames) {
      if (job->second.FindIndex(frame.frame_number)) continue;
      return absl::FailedPreconditionError(
          absl::StrCat(name, " has no frame ", frame.frame_number,
                       " to wait for; wait for the whole job, or submit only frames that it has"));
    }
  }
  return absl::OkStatus();
}

void JudgeDependencies(WorkState& state, JobRecord* job) {
  job->blocked = IsBlocked(state.jobs, *job);
  const bool by_frame = std::ranges::any_of(job->spec.dependencies, &JobDependency::by_frame);
  for (uint32_t index = 0; by_frame && index < job->frames.size(); ++index) {
    JudgeFrame(state, job, index);
  }
  UpdateReadyJob(state, job);
}

void JudgeDependents(WorkState& state, uint64_t job_id) {
  for (const uint64_t id : state.dependents.Of(job_id))
    JudgeDependencies(state, &state.jobs.at(id));
}

void JudgeDependentsOn(WorkState& state, const FrameId& frame) {
  for (const uint64_t id : state.dependents.Of(frame.job_id)) {
    JobRecord& job = state.jobs.at(id);
    if (const std::optional<uint32_t> index = job.FindIndex(frame.frame_number)) {
      JudgeFrame(state, &job, *index);
    }
  }
}

void Release(WorkState& state, uint64_t job_id) {
  JobRecord& job = state.jobs.at(job_id);
  for (JobDependency& dependency : job.spec.dependencies) dependency.released = true;
  JudgeDependencies(state, &job);
}

void NoteRemoved(WorkState& state, uint64_t job_id) {
  for (auto& [id, job] : state.jobs) {
    for (JobDependency& dependency : job.spec.dependencies) {
      if (dependency.job_id == job_id) dependency.removed = true;
    }
  }
}

bool IsAwaited(const WorkState& state, uint64_t job_id) {
  if (state.jobs.at(job_id).phase == JobPhase::kSucceeded) return false;
  const std::set<uint64_t>& dependents = state.dependents.Of(job_id);
  return std::ranges::any_of(dependents, [&](uint64_t id) {
    return std::ranges::any_of(state.jobs.at(id).spec.dependencies,
                               [job_id](const JobDependency& dependency) {
                                 return dependency.job_id == job_id && !dependency.released;
                               });
  });
}

}  // namespace sheaf::coordinator::scheduling
