// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Grants leases, and says when a worker must ask again.
#pragma once

#include "coordinator/scheduling/work_state.h"

namespace sheaf::coordinator::scheduling {

// How many leases the worker should hold: as many as it asks for, within its proven capacity.
size_t LeasesWanted(const WorkState& state, const WorkerRecord& worker);
bool MayHoldMore(const WorkState& state, const WorkerRecord& worker);
absl::Duration BusyInterval(const WorkState& state);
absl::Duration NextSynchronize(const WorkState& state, const WorkerRecord& worker, SteadyTime now);
bool Grant(WorkState& state, WorkerRecord* worker, SteadyTime now);
bool GrantFromFrames(WorkState& state, JobRecord* job, const JobRecord::FrameSet& frames,
                     WorkerRecord* worker, SteadyTime now);
bool GrantByOpening(WorkState& state, JobRecord* job, uint32_t index, WorkerRecord* worker,
                    SteadyTime now);
void AddLease(WorkState& state, JobRecord* job, FrameRecord* frame, const Task& task,
              WorkerRecord* worker, bool is_check, SteadyTime now);
// Compares the cost of a result with the frame's earlier results. Before it is counted.
void NoteSpeed(WorkState& state, const FrameRecord& frame, const std::string& worker_id,
               uint64_t samples, const ResultCost& cost);
bool MayOpenFor(const WorkState& state, const FrameRecord& frame, const WorkerRecord& worker);
bool Hedge(WorkState& state, WorkerRecord* worker, SteadyTime now);
// Whether the task needs a guiding field that is lost and not yet made again.
bool AwaitsField(const FrameRecord& frame, uint32_t tile);
// HoldScenes named the frame's scene.
bool IsHeld(const WorkState& state, const FrameRecord& frame);

}  // namespace sheaf::coordinator::scheduling
