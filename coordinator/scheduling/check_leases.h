// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Has results rendered again by other identities, to detect false ones (result_checks.h).
#pragma once

#include "coordinator/scheduling/work_state.h"

namespace sheaf::coordinator::scheduling {

// As Scheduler has them.
void ConsiderCheck(WorkState& state, const FrameId& id, const Task& task,
                   const ResultVersion& merged, double draw);
CheckVerdict Compare(WorkState& state, const FrameId& id, const Task& task, uint64_t lease_id,
                     const std::string& worker_id, const ResultVersion& merged,
                     const ResultVersion& version, const ResultCost& cost, SteadyTime now);
bool AwaitsChecks(WorkState& state, const FrameId& id, SteadyTime now);
std::string WhyAwaitsChecks(const WorkState& state, const FrameId& id);

bool MayCheck(WorkState& state, const TaskId& task, const WorkerRecord& worker, bool urgent_only);
// urgent_only: those whose scene is warm in the worker, or whose frame waits for nothing else.
bool GrantCheck(WorkState& state, WorkerRecord* worker, bool urgent_only, SteadyTime now);
void DropCheckLeases(WorkState& state, const TaskId& task);
void DropChecks(WorkState& state, const FrameId& id);
// Counts a worker's delivery under a lease granted at grant_time.
void NoteDelivery(WorkState& state, const std::string& worker_id, uint64_t samples,
                  const ResultCost& cost, SteadyTime grant_time, SteadyTime now);

}  // namespace sheaf::coordinator::scheduling
