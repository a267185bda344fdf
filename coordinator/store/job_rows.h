// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The rows of jobs and their frames. Each change of a job's state seals the state again. Contracts
// are those of JobStore; errors those of Statement::Step.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "coordinator/store/database/database.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator::rows {

// With frames, effects, failures and holds. Errors: also kDataLoss.
absl::StatusOr<std::vector<StoredJob>> LoadJobs(Database* database);
absl::StatusOr<std::optional<uint64_t>> FindRequest(const std::string& request_id,
                                                    Database* database);
// In a transaction of the caller. id_min: the least id that the job may get.
absl::StatusOr<JobStore::CreatedJob> InsertJob(const JobSpec& spec, const std::string& request_id,
                                               absl::Time create_time, uint64_t id_min,
                                               Database* database);
absl::Status EndJob(uint64_t job_id, JobPhase phase, const std::string& failure,
                    absl::Time end_time, absl::Duration wall, Database* database);
absl::Status ChangeJob(uint64_t job_id, const JobChange& change, Database* database);
absl::Status SetWarning(uint64_t job_id, const std::string& warning, Database* database);
absl::Status DeliverFrame(const FrameId& frame, const DeliveredFrame& delivered,
                          Database* database);
absl::Status ReopenJob(uint64_t job_id, const std::vector<JobStore::ReopenedFrame>& frames,
                       Database* database);

// In a transaction of the caller: removes the rows of a job, and notes that its files are left.
// parts_bytes gets the bytes of its parts.
absl::Status RemoveJob(uint64_t job_id, uint64_t* parts_bytes, Database* database);
absl::Status NoteFilesRemoved(uint64_t job_id, Database* database);
// The jobs whose files may be left.
absl::StatusOr<std::vector<uint64_t>> RemovedJobs(Database* database);
absl::StatusOr<std::vector<uint64_t>> EndedJobs(Database* database);

}  // namespace sheaf::coordinator::rows
