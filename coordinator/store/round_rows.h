// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The rows of rounds. Contracts and errors are those of JobStore.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/store/database/database.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator::rows {

// As JobStore::AddRound.
absl::Status InsertRound(const FrameId& frame, const RoundRecord& round, Database* database);
absl::StatusOr<std::vector<StoredRound>> LoadRounds(uint64_t job_id, bool with_cells,
                                                    Database* database);
absl::StatusOr<std::vector<RoundRecord>> LoadFrameRounds(const FrameId& frame, Database* database);

}  // namespace sheaf::coordinator::rows
