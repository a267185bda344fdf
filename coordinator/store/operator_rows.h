// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The rows of what operators decide and the farm finds about people and machines: quarantines,
// shares and drained workers. Contracts and errors are those of JobStore.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/store/database/database.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator::rows {

absl::Status WriteQuarantine(const QuarantineRecord& record, Database* database);
absl::Status RemoveQuarantine(const std::string& identity, Database* database);
absl::StatusOr<std::vector<QuarantineRecord>> LoadQuarantines(Database* database);

absl::Status WriteShare(const ShareSubject& subject, const ShareSetting& setting,
                        Database* database);
absl::Status RemoveShare(const ShareSubject& subject, Database* database);
absl::StatusOr<std::map<ShareSubject, ShareSetting>> LoadShares(Database* database);

absl::Status WriteDrains(const std::vector<DrainRecord>& records, Database* database);
absl::Status RemoveDrains(const std::vector<std::string>& worker_ids, Database* database);
absl::StatusOr<std::vector<DrainRecord>> LoadDrains(Database* database);

}  // namespace sheaf::coordinator::rows
