// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of Scheduler that tracks the guiding fields of frames.
#include "coordinator/scheduling/scheduler.h"

namespace sheaf::coordinator {

void Scheduler::RestoreField(const FrameId& id, const BlobDigest& field) {
  JobRecord& job = jobs_.at(id.job_id);
  const uint32_t index = job.IndexOf(id.frame_number);
  if (job.frames[index].phase == FrameRecord::Phase::kPending) Open(&job, index);
  job.frames[index].tasks->SetField(field);
}

void Scheduler::SetField(const FrameId& id, const BlobDigest& field) {
  Frame(id).tasks->SetField(field);
  ++counters_.fields_trained;
}

bool Scheduler::AwaitsField(const FrameRecord& frame, uint32_t tile) {
  const FrameTasks& tasks = *frame.tasks;
  return !tasks.Trained() && tasks.grid().KindOf(tile) != TaskKind::kTraining;
}

}  // namespace sheaf::coordinator
