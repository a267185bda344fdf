// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tasks that are set aside, on the wire.
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {

void AddTroubles(const FrameView& view, v1::Job* job) {
  if (view.incomplete.empty() && view.set_aside_count == 0) return;
  v1::FrameTrouble& wire = *job->add_troubles();
  wire.set_frame_number(view.frame_number);
  wire.set_incomplete(view.incomplete);
  wire.set_set_aside_task_count(view.set_aside_count);
  for (const SetAsideView& aside : view.set_aside) {
    v1::SetAsideTask& task = *wire.add_set_aside_tasks();
    task.set_task(aside.task);
    task.set_why(aside.why);
    for (const TaskFailure& failure : aside.failures) *task.add_failures() = ToWire(failure);
  }
}

}  // namespace sheaf::coordinator
