// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Restores stored jobs into the scheduler: after a start, when they are created, and when they are
// continued.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/service/farm/jobs/job_context.h"

namespace sheaf::coordinator {

// Restores all stored jobs. Call once, first. Errors: those of the store; kDataLoss.
absl::Status LoadJobs(JobContext& context);

// Restores a job from its durable state: its delivered frames, rounds (with cells if it is live)
// and, if it is live, parts and the images that its frames resume. parts: null if a live job cannot
// continue. Requires: the scheduler does not have the job; the job has an account.
void RestoreJob(JobContext& context, const StoredJob& job, std::vector<StoredRound> rounds,
                const JobStore::LoadedParts* parts, const ResumedCounts& resumed)
    ABSL_EXCLUSIVE_LOCKS_REQUIRED(context.tables.mutex);

// The parts of a job, without the given ones and those no longer needed. Lost parts become parts no
// longer needed. Errors: those of JobStore::LoadParts.
absl::StatusOr<JobStore::LoadedParts> LoadPartsOf(JobContext& context, uint64_t job_id,
                                                  const std::vector<PartRow>& without = {});

}  // namespace sheaf::coordinator
