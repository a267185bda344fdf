// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Scheduler that pauses, resumes and prioritizes jobs.
#include <algorithm>
#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "coordinator/scheduling/scheduler.h"

namespace sheaf::coordinator {

std::optional<uint64_t> Scheduler::LeastServedBeside(const JobRecord& job) const {
  const auto ready = ready_jobs_.find(job.spec.numeric_profile);
  if (ready == ready_jobs_.end()) return std::nullopt;
  const auto least = ready->second.lower_bound({-job.spec.priority, 0, 0});
  if (least == ready->second.end() || std::get<0>(*least) != -job.spec.priority) {
    return std::nullopt;
  }
  return std::get<1>(*least);
}

void Scheduler::Pause(uint64_t job_id, SteadyTime now) {
  JobRecord& job = jobs_.at(job_id);
  if (job.phase != JobPhase::kLive || job.Paused()) return;
  job.paused_time = now;
  UpdateReadyJob(&job, KeyOf(job));
}

void Scheduler::Resume(uint64_t job_id, SteadyTime now) {
  JobRecord& job = jobs_.at(job_id);
  if (job.phase != JobPhase::kLive || !job.Paused()) return;
  const absl::Duration pause = std::max(absl::ZeroDuration(), now - job.paused_time);
  for (FrameRecord& frame : job.frames) frame.first_lease_time += pause;
  job.paused_time = SteadyTime::InfiniteFuture();
  const JobKey key_before = KeyOf(job);
  // Like a new job it has no claim on what others had meanwhile.
  job.served = std::max(job.served, LeastServedBeside(job).value_or(0));
  UpdateReadyJob(&job, key_before);
}

absl::Status Scheduler::CheckPriority(int32_t priority) const {
  // Not by its magnitude: the least number has none.
  if (priority >= -limits_.priority_magnitude_max && priority <= limits_.priority_magnitude_max) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("priority ", priority, " is outside +-", limits_.priority_magnitude_max));
}

void Scheduler::SetPriority(uint64_t job_id, int32_t priority) {
  JobRecord& job = jobs_.at(job_id);
  if (job.spec.priority == priority) return;
  const JobKey key_before = KeyOf(job);
  job.spec.priority = priority;
  // It begins level with those that it comes among: what it had among others is theirs to count.
  job.served = LeastServedBeside(job).value_or(job.served);
  UpdateReadyJob(&job, key_before);
}

}  // namespace sheaf::coordinator
