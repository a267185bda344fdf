// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The tables of the jobs database, and their changes in each version of Sheaf. The same for SQLite
// and PostgreSQL.
#pragma once

#include <span>

#include "absl/status/status.h"
#include "coordinator/store/database/database.h"

namespace sheaf::coordinator {

// The tables of new databases, and the additions of each version of Sheaf after the first. `tables`
// includes all additions.
struct SchemaHistory {
  const char* tables;
  std::span<const char* const> additions;
};

// Creates the tables of a new database, or adds to those of an earlier version, in one transaction.
// Errors: kFailedPrecondition, with its name, if a later version wrote it.
absl::Status UpdateSchema(Database* database, const SchemaHistory& history);
// The same with the tables of this version.
absl::Status UpdateSchema(Database* database);

// Checks that the tables have the names and columns that UpdateSchema makes: SQLite's own check
// does not detect a changed bit in them. Errors: kDataLoss, naming the missing or unknown column.
absl::Status CheckSchema(Database* database);

}  // namespace sheaf::coordinator
