// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The rows of parts, without their bytes. Contracts are those of JobStore; errors those of
// Statement::Step.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/store/database/database.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator::rows {

// Inserts rows in a transaction of the caller, several by one statement. outcomes: of each row;
// kAlreadyExists if its key has a part. Requires: no two rows are equal. An error ends the
// transaction.
absl::Status InsertParts(std::span<const PartRow* const> rows, std::vector<absl::Status>* outcomes,
                         Database* database);
// The rows of a job; `lost` gets those that changed on disk.
absl::StatusOr<std::vector<PartRow>> LoadPartRows(uint64_t job_id, std::vector<PartRow>* lost,
                                                  Database* database);
absl::StatusOr<std::optional<PartRow>> FindPart(const PartKey& key, Database* database);
absl::StatusOr<std::vector<PartRow>> FindTileParts(const FrameId& frame, const PixelRect& tile,
                                                   TaskKind kind, Database* database);
absl::StatusOr<std::vector<PartRow>> ListParts(uint64_t job_id, Database* database);
absl::StatusOr<std::vector<PartRow>> FindPartsOf(const std::string& identity, Database* database);
absl::StatusOr<std::vector<JobStore::TileCost>> TileCosts(const FrameId& frame, Database* database);
absl::StatusOr<std::optional<FrameId>> OldestDeliveredWithParts(Database* database);
absl::StatusOr<std::map<uint64_t, uint64_t>> PartsBytesByJob(Database* database);

// Each returns the bytes of the parts whose rows it deletes: 0 if there is none.
absl::StatusOr<uint64_t> DeletePart(const PartKey& key, Database* database);
absl::StatusOr<uint64_t> DeleteFrameParts(const FrameId& frame, Database* database);
// The bytes of all parts.
absl::StatusOr<uint64_t> PartsBytes(Database* database);
absl::StatusOr<bool> HasParts(const FrameId& frame, Database* database);

}  // namespace sheaf::coordinator::rows
