// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The tables of farm.db, and what each version of Sheaf added to them.
#pragma once

#include <string>

#include "absl/status/status.h"
#include "coordinator/store/sqlite_database.h"

namespace sheaf::coordinator {

// Makes the tables of a new database, or brings those of an earlier version up to date.
// Errors: kFailedPrecondition, naming the path: it was written by a later version.
absl::Status MigrateSchema(SqliteDatabase* database, const std::string& path);

}  // namespace sheaf::coordinator
