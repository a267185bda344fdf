// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The rows of jobs' events and of failed leases, for display, and of the workers that failed each
// task. Contracts and errors are those of JobStore.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/store/database/database.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator::rows {

absl::Status WriteFailures(uint64_t job_id, const FailureLog& failures, Database* database);
// Adds to the jobs in the map, which is keyed by job id, and ignores rows of other jobs.
absl::Status LoadFailures(const std::map<uint64_t, StoredJob*>& jobs, Database* database);
absl::Status WriteTroubles(const std::vector<TaskTrouble>& troubles, Database* database);
absl::StatusOr<std::vector<TaskTrouble>> LoadTroubles(uint64_t job_id, Database* database);
absl::Status AppendEvents(const std::vector<JobEvent>& events, Database* database);
absl::StatusOr<std::vector<JobEvent>> LoadEvents(uint64_t job_id, Database* database);

}  // namespace sheaf::coordinator::rows
