// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The rows of accounts (coordinator/core/policy/usage.h). Errors: those of Statement::Step.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/store/database/database.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator::rows {

// Adds to today's row of the subject.
absl::Status AddUsage(const JobStore::UsageOf& of, const Usage& usage, Database* database);
// Removes rows older than kUsageDaysKept.
absl::Status RemoveOldUsage(Database* database);
// The rows of the query's days and owner.
absl::StatusOr<std::vector<UsageRow>> LoadUsage(const UsageQuery& query, Database* database);

}  // namespace sheaf::coordinator::rows
