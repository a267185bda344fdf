// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Scheduler that pauses, resumes and prioritizes jobs.
#include <algorithm>
#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "coordinator/scheduling/scheduler.h"

namespace sheaf::coordinator {

void Scheduler::Pause(uint64_t job_id, SteadyTime now) {
  JobRecord& job = jobs_.at(job_id);
  if (job.phase != JobPhase::kLive || job.Paused()) return;
  job.paused_time = now;
  UpdateReadyJob(&job);
}

void Scheduler::Resume(uint64_t job_id, SteadyTime now) {
  JobRecord& job = jobs_.at(job_id);
  if (job.phase != JobPhase::kLive || !job.Paused()) return;
  const absl::Duration pause = std::max(absl::ZeroDuration(), now - job.paused_time);
  for (FrameRecord& frame : job.frames) frame.first_lease_time += pause;
  job.paused_time = SteadyTime::InfiniteFuture();
  UpdateReadyJob(&job);
}

absl::Status Scheduler::CheckPriority(int32_t priority) const {
  // Does not use the magnitude: the smallest integer has none.
  if (priority >= -limits_.priority_magnitude_max && priority <= limits_.priority_magnitude_max) {
    return absl::OkStatus();
  }
  return absl::InvalidArgumentError(
      absl::StrCat("priority ", priority, " is outside +-", limits_.priority_magnitude_max));
}

void Scheduler::SetPriority(uint64_t job_id, int32_t priority) {
  JobRecord& job = jobs_.at(job_id);
  if (job.spec.priority == priority) return;
  job.spec.priority = priority;
  if (job.phase == JobPhase::kLive) shares_.SetPriority(job_id, priority);
}

}  // namespace sheaf::coordinator
