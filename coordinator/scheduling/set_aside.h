// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sets tasks aside, ends frames without them, and retries them.
#pragma once

#include "coordinator/scheduling/work_state.h"

namespace sheaf::coordinator::scheduling {

// As Scheduler has them.
void RestoreTrouble(WorkState& state, const TaskTrouble& trouble);
absl::Status Kill(WorkState& state, const FrameId& id, std::optional<uint32_t> tile,
                  const std::string& why);
void Retry(WorkState& state, uint64_t job_id, std::optional<int32_t> number,
           std::optional<uint32_t> tile);

TaskFailures& FailuresOf(FrameRecord* frame, const Lease& lease);
void NoteTrouble(WorkState& state, const TaskId& id, const TaskFailures& failures);
void ForgetTrouble(WorkState& state, FrameRecord* frame, const TaskId& id);
void ForgetTroubles(WorkState& state, FrameRecord* frame);
// Sets the task aside, at once or when its last lease ends.
void SetAside(WorkState& state, FrameRecord* frame, const TaskId& id, const std::string& why);
void CloseStuckFrames(WorkState& state);
// Fails a job whose frames are all delivered or incomplete.
void JudgeIncompleteJob(WorkState& state, JobRecord* job);
std::string TaskFailureText(const FrameRecord& frame, const TaskFailures& failures);
// Refuses the frame to a worker that lacks the memory for it, as long as that helps.
void RefuseForMemory(WorkState& state, const FrameId& id, const std::string& worker_id);

}  // namespace sheaf::coordinator::scheduling
