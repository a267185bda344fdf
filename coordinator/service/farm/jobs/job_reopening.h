// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ReopenFrames: continues frames of a job that have ended, from the parts that stay. Refinements,
// retries, approvals and corrections end in it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/service/farm/jobs/job_context.h"

namespace sheaf::coordinator {

// Continues these frames of a job, without the false parts, which are removed. Requires: the job
// has ended, or no result is taken meanwhile. Errors: those of the store; no part is removed then,
// and the call can be repeated.
absl::Status ReopenFrames(JobContext& context, StoredJob job,
                          const std::vector<JobStore::ReopenedFrame>& reopened,
                          const std::vector<PartRow>& false_parts = {},
                          bool may_have_failed = false)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.settle_mutex);

// The job with all its frames, for ReopenFrames.
StoredJob StoredJobOf(JobContext& context, const JobRecord& record)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.tables.mutex);
// By frame, with their cells. Errors: those of JobStore::LoadRounds.
absl::StatusOr<std::map<int32_t, std::vector<RoundRecord>>> RoundsOf(JobContext& context,
                                                                     uint64_t job_id);
// Removes parts, and counts their cost as lost.
void RemoveFalse(JobContext& context, const std::vector<PartRow>& parts);
// ", frame 3, task 4" for logs; "" for a whole job.
std::string NameOfWork(std::optional<int32_t> frame, std::optional<uint32_t> task);

}  // namespace sheaf::coordinator
