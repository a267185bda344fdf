// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Holds back jobs and frames that wait for others.
#pragma once

#include "coordinator/scheduling/work_state.h"

namespace sheaf::coordinator::scheduling {

// As Scheduler has them.
absl::Status CheckDependencies(const WorkState& state, const JobSpec& spec);
void Release(WorkState& state, uint64_t job_id);
void NoteRemoved(WorkState& state, uint64_t job_id);
bool IsAwaited(const WorkState& state, uint64_t job_id);

// Updates whether the job and its frames are blocked, after a change to jobs that they wait for.
void JudgeDependencies(WorkState& state, JobRecord* job);
// Does the same for all jobs that wait for a job, or for a frame of it.
void JudgeDependents(WorkState& state, uint64_t job_id);
void JudgeDependentsOn(WorkState& state, const FrameId& frame);

}  // namespace sheaf::coordinator::scheduling
