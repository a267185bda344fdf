// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Database: an SQL database with C++ values and statuses; SqliteDatabase and PostgresDatabase
// implement it. Statements are written once, in the SQL that both understand:
//
//   - parameters are "?", or "?1", "?2" and so on throughout the statement;
//   - INSERT ... ON CONFLICT (the former's columns by the table's name), not INSERT OR;
//   - sums are CAST(SUM(x) AS BIGINT), conditions are comparisons ("delivered = 1");
//   - there is no MIN or MAX of two values;
//   - a whole number has 64 bits, and text is UTF-8 without zero bytes.
//
// Scripts that make tables have SQLite's types; PostgresDatabase turns them into its own
// (postgres_sql.h).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "absl/time/time.h"

namespace sheaf::coordinator {

// The work of an implementation for a Statement. Parameters count from 1, columns from 0; errors of
// preparing and binding are returned by Step.
class PreparedStatement {
 public:
  virtual ~PreparedStatement() = default;
  virtual void BindInt64(int parameter, int64_t value) = 0;
  virtual void BindDouble(int parameter, double value) = 0;
  virtual void BindText(int parameter, std::string_view text) = 0;
  virtual void BindBytes(int parameter, std::string_view bytes) = 0;
  virtual absl::StatusOr<bool> Step() = 0;
  // Ends the statement, so that it can run again.
  virtual void Reset() = 0;
  virtual void ClearParameters() = 0;
  virtual int64_t Int64(int column) const = 0;
  virtual double Double(int column) const = 0;
  virtual std::string Text(int column) const = 0;
  virtual std::string Bytes(int column) const = 0;
};

// A prepared statement. Parameters are bound in their order; columns count from 0. Thread safety:
// as for its database, one thread at a time. It does not outlive its database.
class Statement {
 public:
  explicit Statement(std::unique_ptr<PreparedStatement> prepared)
      : prepared_(std::move(prepared)) {}

  // Bind the next parameter; the first call after a Step starts again at the first one.
  Statement& Bind(int64_t value);
  Statement& Bind(uint64_t value) { return Bind(static_cast<int64_t>(value)); }
  Statement& Bind(int32_t value) { return Bind(static_cast<int64_t>(value)); }
  Statement& Bind(double value);
  Statement& Bind(const std::string& value);
  Statement& BindBytes(std::string_view bytes);

  // Returns true if there is a row, false at the end. Errors: kAlreadyExists (a key exists
  // already), kResourceExhausted (disk full), kDataLoss (the database is damaged), kUnavailable;
  // those of Database::InTransaction if the statement changes something outside a transaction.
  absl::StatusOr<bool> Step();
  // Steps to the end and ignores rows.
  absl::Status Run();

  int64_t Int64(int column) const { return prepared_->Int64(column); }
  double Double(int column) const { return prepared_->Double(column); }
  std::string Text(int column) const { return prepared_->Text(column); }
  std::string Bytes(int column) const { return prepared_->Bytes(column); }

 private:
  int NextParameter();

  std::unique_ptr<PreparedStatement> prepared_;
  int bound_count_ = 0;
  bool stepped_ = false;
};

// Thread safety: one thread at a time.
class Database {
 public:
  Database() = default;
  virtual ~Database() = default;
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  // Its name in messages: a path, or a server and a database.
  virtual std::string Name() const = 0;

  // Runs statements without parameters, separated by semicolons.
  virtual absl::Status Execute(const std::string& sql) = 0;
  virtual Statement Prepare(const std::string& sql) = 0;
  // How many rows the last statement inserted, changed or removed.
  virtual int64_t ChangedRows() const = 0;
  // Runs `body` as one transaction: when this returns OK, all its changes are durable; after an
  // error there are none. Errors: those of `body` and of Statement::Step; kAborted if another
  // coordinator owns the database (farm_ownership.h).
  absl::Status InTransaction(const std::function<absl::Status()>& body);

  // The version of the tables: 0 in a new database, then the last value set. Setting it is part of
  // a transaction.
  virtual absl::StatusOr<int64_t> SchemaVersion() = 0;
  virtual absl::Status SetSchemaVersion(int64_t version) = 0;
  // "table.column" of all.
  virtual absl::StatusOr<std::set<std::string>> TableColumns() = 0;

  // Checks the integrity of the stored data within the given time, if the database does not check
  // itself. Errors: kDataLoss.
  virtual absl::Status Check(absl::Duration time_max) = 0;
  // An upper bound of the commits lost before it was opened: see lost_commits.h.
  virtual int64_t LostCommits() const { return 0; }
  // Advice to operators about a damaged database of a state directory: one or more sentences.
  virtual std::string Remedy(const std::string& state_directory) const = 0;

 protected:
  virtual absl::Status Begin() = 0;
  virtual absl::Status Commit() = 0;
  virtual void Rollback() = 0;
};

}  // namespace sheaf::coordinator
