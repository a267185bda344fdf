// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Prefers work of scenes that the worker has (placement.h).
#pragma once

#include "coordinator/scheduling/work_state.h"

namespace sheaf::coordinator::scheduling {

// Update warm_workers_, scene_jobs_ and opened_jobs_ after a change to a worker, or to the job's
// work of a scene.
void NoteWarm(WorkState& state, const WorkerRecord& worker);
void NoteWork(WorkState& state, JobRecord* job, const PackedDigest& scene);
// The oldest jobs with open frames, in that order.
std::vector<uint64_t> OpenedJobs(const WorkState& state, const WorkerRecord& worker);
// front: jobs in order of service. Warm scenes may override the order among equal priorities
// (placement.h).
bool GrantPlaced(WorkState& state, std::span<const uint64_t> front, WorkerRecord* worker,
                 SteadyTime now);
// Grants work of the job for scenes that the worker has; the next, any work of the job.
bool GrantWarm(WorkState& state, JobRecord* job, WorkerRecord* worker, SteadyTime now);

}  // namespace sheaf::coordinator::scheduling
