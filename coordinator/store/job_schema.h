// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The tables of the database of jobs, and the changes to them in each version of Sheaf: the same
// for SQLite and PostgreSQL.
#pragma once

#include "absl/status/status.h"
#include "coordinator/store/database/database.h"

namespace sheaf::coordinator {

// Creates the tables of a new database at once, or adds to those of an earlier version what each
// version since has added. Errors: kFailedPrecondition, with its name, if a later version wrote it.
absl::Status MigrateSchema(Database* database);

// Whether the tables have the names and columns that MigrateSchema makes: SQLite's own check does
// not see a changed bit in them. Errors: kDataLoss, with what is missing or unknown.
absl::Status CheckSchema(Database* database);

}  // namespace sheaf::coordinator
