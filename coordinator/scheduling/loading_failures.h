// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Handles scenes whose loading kills workers.
#pragma once

#include "coordinator/scheduling/work_state.h"

namespace sheaf::coordinator::scheduling {

// A worker renders or has rendered the frame.
void NoteLoaded(WorkState& state, const FrameId& id);
// The lease's worker vanished while it loaded the frame's scene.
void CountLoadingLoss(WorkState& state, const Lease& lease);
// Derives them from the known failures of a job. Before its parts.
void RestoreLoadingLosses(WorkState& state, JobRecord* job);

}  // namespace sheaf::coordinator::scheduling
