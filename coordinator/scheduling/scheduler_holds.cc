// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Scheduler that holds back jobs with dependencies, and drained workers.
#include <algorithm>
#include <set>

#include "absl/strings/str_cat.h"
#include "coordinator/scheduling/scheduler.h"

namespace sheaf::coordinator {

absl::Status Scheduler::CheckDependencies(const JobSpec& spec) const {
  if (spec.dependencies.empty()) return absl::OkStatus();
  if (spec.pilot) return absl::InvalidArgumentError("dependencies: the pilot of a quote has none");
  if (spec.dependencies.size() > limits_.job_dependencies_max) {
    return absl::InvalidArgumentError(
        absl::StrCat("dependencies: a job waits for ", limits_.job_dependencies_max,
                     " others at most; let it wait for one that waits for the rest"));
  }
  std::set<uint64_t> named;
  for (const JobDependency& dependency : spec.dependencies) {
    const std::string name = absl::StrCat("jobs/", dependency.job_id);
    if (!named.insert(dependency.job_id).second) {
      return absl::InvalidArgumentError(absl::StrCat("dependencies: ", name, " is named twice"));
    }
    const auto job = jobs_.find(dependency.job_id);
    if (job == jobs_.end() || job->second.spec.pilot) {
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

void Scheduler::JudgeDependencies(JobRecord* job) {
  job->blocked = IsBlocked(jobs_, *job);
  const bool by_frame = std::ranges::any_of(job->spec.dependencies, &JobDependency::by_frame);
  for (uint32_t index = 0; by_frame && index < job->frames.size(); ++index) {
    JudgeFrame(job, index);
  }
  UpdateReadyJob(job);
}

void Scheduler::JudgeFrame(JobRecord* job, uint32_t index) {
  FrameRecord& frame = job->frames[index];
  const bool is_blocked = IsBlocked(jobs_, *job, frame.number());
  if (frame.blocked == is_blocked) return;
  frame.blocked = is_blocked;
  UpdateReady(job, index);
}

void Scheduler::JudgeDependents(uint64_t job_id) {
  for (const uint64_t id : dependents_.Of(job_id)) JudgeDependencies(&jobs_.at(id));
}

void Scheduler::JudgeDependentsOn(const FrameId& frame) {
  for (const uint64_t id : dependents_.Of(frame.job_id)) {
    JobRecord& job = jobs_.at(id);
    if (const std::optional<uint32_t> index = job.FindIndex(frame.frame_number)) {
      JudgeFrame(&job, *index);
    }
  }
}

void Scheduler::Release(uint64_t job_id) {
  JobRecord& job = jobs_.at(job_id);
  for (JobDependency& dependency : job.spec.dependencies) dependency.released = true;
  JudgeDependencies(&job);
}

void Scheduler::NoteRemoved(uint64_t job_id) {
  for (auto& [id, job] : jobs_) {
    for (JobDependency& dependency : job.spec.dependencies) {
      if (dependency.job_id == job_id) dependency.removed = true;
    }
  }
}

bool Scheduler::IsAwaited(uint64_t job_id) const {
  if (jobs_.at(job_id).phase == JobPhase::kSucceeded) return false;
  const std::set<uint64_t>& dependents = dependents_.Of(job_id);
  return std::ranges::any_of(dependents, [&](uint64_t id) {
    return std::ranges::any_of(jobs_.at(id).spec.dependencies,
                               [job_id](const JobDependency& dependency) {
                                 return dependency.job_id == job_id && !dependency.released;
                               });
  });
}

void Scheduler::Drain(const std::string& worker_id, bool then_exit) {
  workers_.Drain(worker_id, then_exit);
}

void Scheduler::Undrain(const std::string& worker_id) { workers_.Undrain(worker_id); }

}  // namespace sheaf::coordinator
