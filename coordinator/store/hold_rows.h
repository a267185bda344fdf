// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The rows of held work (job_holds.h): dependencies and approvals. Errors: those of
// Statement::Step.
#pragma once

#include <cstdint>
#include <map>

#include "absl/status/status.h"
#include "coordinator/store/database/database.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator::rows {

// Stores those of a new job.
absl::Status InsertHolds(uint64_t job_id, const JobSpec& spec, Database* database);
// Adds to the jobs in the map, which is keyed by job id, and ignores rows of other jobs.
absl::Status LoadHolds(const std::map<uint64_t, StoredJob*>& jobs, Database* database);
// Approves the frame if it waits for this many samples or fewer.
absl::Status NoteApproval(const FrameId& frame, uint64_t samples, Database* database);
// Called when a job is removed.
absl::Status RemoveHolds(uint64_t job_id, Database* database);
// As JobStore::ReleaseJob.
absl::Status ReleaseJob(uint64_t job_id, Database* database);

}  // namespace sheaf::coordinator::rows
