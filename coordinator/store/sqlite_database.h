// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SQLite with C++ values and statuses. All access to sqlite3 goes through this file.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "coordinator/store/durability.h"

struct sqlite3;
struct sqlite3_stmt;

namespace sheaf::coordinator {

// A prepared statement. Parameters and columns are addressed by position: parameters from 1,
// columns from 0. Errors in preparing and binding are returned by Step. Thread safety: as for its
// database, one thread at a time.
class SqliteStatement {
 public:
  // statement: null if `prepared` is an error.
  SqliteStatement(sqlite3* database, sqlite3_stmt* statement, absl::Status prepared);
  ~SqliteStatement();
  SqliteStatement(SqliteStatement&& other) noexcept;
  SqliteStatement& operator=(SqliteStatement&&) = delete;

  // Bind the next parameter; the first call after a Step starts again at 1.
  SqliteStatement& Bind(int64_t value);
  SqliteStatement& Bind(uint64_t value) { return Bind(static_cast<int64_t>(value)); }
  SqliteStatement& Bind(int32_t value) { return Bind(static_cast<int64_t>(value)); }
  SqliteStatement& Bind(double value);
  SqliteStatement& Bind(const std::string& value);
  SqliteStatement& BindBytes(std::string_view bytes);

  // Returns true if there is a row, false at the end. Errors: kAlreadyExists (a key exists
  // already), kResourceExhausted (disk full), kDataLoss (the database is damaged), kUnavailable.
  absl::StatusOr<bool> Step();
  // Steps to the end and ignores rows.
  absl::Status Run();

  int64_t Int64(int column) const;
  double Double(int column) const;
  std::string Text(int column) const;
  std::string Bytes(int column) const;

 private:
  void Rewind();
  void NoteBound(int result);

  sqlite3* database_;
  sqlite3_stmt* statement_;
  absl::Status status_;  // The status of the calls before Step.
  int bound_count_ = 0;
  bool stepped_ = false;
};

// Thread safety: one thread at a time.
class SqliteDatabase {
 public:
  // Opens or creates the file, in WAL mode. Errors: kUnavailable, kPermissionDenied,
  // kResourceExhausted, with the path; kDataLoss.
  static absl::StatusOr<std::unique_ptr<SqliteDatabase>> Open(
      const std::string& path, Durability durability = Durability::kPowerLoss);
  ~SqliteDatabase();
  // How many commits were lost when it was opened, at most: see lost_commits.h.
  int64_t lost_commits() const { return lost_commits_; }
  SqliteDatabase(const SqliteDatabase&) = delete;
  SqliteDatabase& operator=(const SqliteDatabase&) = delete;

  // Runs statements separated by semicolons.
  absl::Status Execute(const std::string& sql);
  SqliteStatement Prepare(const std::string& sql);
  // Checks the integrity of the file within the given time; a large file is only checked in part.
  // Errors: kDataLoss.
  absl::Status Check(absl::Duration time_max);

 private:
  SqliteDatabase(sqlite3* database, int64_t lost_commits)
      : database_(database), lost_commits_(lost_commits) {}
  sqlite3* database_;
  const int64_t lost_commits_;
};

}  // namespace sheaf::coordinator
