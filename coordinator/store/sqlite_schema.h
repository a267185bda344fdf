// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The tables of farm.db, and the changes to them in each version of Sheaf.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "coordinator/store/sqlite_database.h"

namespace sheaf::coordinator {

// Creates the tables of a new database, or updates those of an earlier version. Errors:
// kFailedPrecondition, with the path, if a later version wrote it.
absl::Status MigrateSchema(SqliteDatabase* database, const std::string& path);

// Whether the tables have the names and columns that MigrateSchema makes: SQLite's own check does
// not see a changed bit in them. Errors: kDataLoss, with what is missing or unknown.
absl::Status CheckSchema(SqliteDatabase* database);

}  // namespace sheaf::coordinator
