// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What PostgreSQL says differently from SQLite, in one place: parameters of statements, and types
// of tables. The rest of the SQL is the same for both (database.h).
//
// Sources: "PREPARE", "Numeric Types" and "Binary Data Types" of PostgreSQL's manual; "Datatypes In
// SQLite" and "Clustered Indexes and the WITHOUT ROWID Optimization" at sqlite.org.
#pragma once

#include <string>
#include <string_view>

namespace sheaf::coordinator {

// "?" becomes "$1", "$2" and so on, and "?3" becomes "$3". Quoted text stays as it is.
std::string PostgresParameters(std::string_view sql);

// INTEGER becomes BIGINT, REAL becomes DOUBLE PRECISION, BLOB becomes BYTEA; AUTOINCREMENT and
// WITHOUT ROWID go. Quoted text stays as it is.
std::string PostgresScript(std::string_view sql);

// Whether the statement only reads.
bool IsQuery(std::string_view sql);

}  // namespace sheaf::coordinator
