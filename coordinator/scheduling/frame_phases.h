// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The phases of jobs and frames, and the sets of ready work that follow from them. Whatever opens,
// closes or ends work calls these.
#pragma once

#include "coordinator/scheduling/work_state.h"

namespace sheaf::coordinator::scheduling {

// As Scheduler has them.
const FrameRecord* FindFrame(const WorkState& state, const FrameId& id);
void EndJob(WorkState& state, uint64_t job_id, JobPhase phase, const std::string& failure);

FrameRecord& Frame(WorkState& state, const FrameId& id);
void UpdateReadyJob(WorkState& state, JobRecord* job);
// Updates the ready sets after a change to a frame or a job.
void UpdateReady(WorkState& state, JobRecord* job, uint32_t index);
bool MayOpen(const WorkState& state, const FrameRecord& frame);
void Open(WorkState& state, JobRecord* job, uint32_t index);
void Close(WorkState& state, JobRecord* job, uint32_t index, FrameRecord::Phase phase);

}  // namespace sheaf::coordinator::scheduling
