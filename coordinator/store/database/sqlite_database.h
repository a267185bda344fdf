// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SqliteDatabase: a database in a file. All access to sqlite3 goes through this file.
#pragma once

#include <cstdint>
#include <memory>
#include <set>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "coordinator/store/database/database.h"
#include "coordinator/store/database/durability.h"

struct sqlite3;

namespace sheaf::coordinator {

// Thread safety: one thread at a time.
class SqliteDatabase : public Database {
 public:
  // Opens or creates the file, in WAL mode. Errors: kUnavailable, kPermissionDenied,
  // kResourceExhausted, with the path; kDataLoss.
  static absl::StatusOr<std::unique_ptr<SqliteDatabase>> Open(
      const std::string& path, Durability durability = Durability::kPowerLoss);
  ~SqliteDatabase() override;

  std::string Name() const override { return path_; }
  absl::Status Execute(const std::string& sql) override;
  Statement Prepare(const std::string& sql) override;
  int64_t ChangedRows() const override;
  absl::StatusOr<int64_t> SchemaVersion() override;
  absl::Status SetSchemaVersion(int64_t version) override;
  absl::StatusOr<std::set<std::string>> TableColumns() override;
  // A large file is only checked in part.
  absl::Status Check(absl::Duration time_max) override;
  int64_t LostCommits() const override { return lost_commits_; }
  std::string Remedy(const std::string& state_directory) const override;
  // The same for a file that cannot be opened.
  static std::string RemedyFor(const std::string& path, const std::string& state_directory);

 protected:
  absl::Status Begin() override { return Execute("BEGIN IMMEDIATE"); }
  absl::Status Commit() override { return Execute("COMMIT"); }
  void Rollback() override { Execute("ROLLBACK").IgnoreError(); }

 private:
  SqliteDatabase(std::string path, sqlite3* database, int64_t lost_commits)
      : path_(std::move(path)), database_(database), lost_commits_(lost_commits) {}
  const std::string path_;
  sqlite3* database_;
  const int64_t lost_commits_;
};

}  // namespace sheaf::coordinator
