// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/sqlite_database.h"

#include <sqlite3.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/base/check.h"
#include "common/base/steady_time.h"
#include "coordinator/store/lost_commits.h"

namespace sheaf::coordinator {
namespace {

constexpr int kBusyTimeoutMs = 5000;
// SQLite's virtual machine runs this many steps between checks of the time: well below a
// millisecond.
constexpr int kCheckSteps = 1000;

absl::Status StatusFromSqlite(int result, sqlite3* database) {
  const char* path = sqlite3_db_filename(database, "main");
  const std::string message =
      absl::StrCat(path == nullptr ? "database" : path, ": ", sqlite3_errmsg(database));
  switch (result & 0xff) {
    case SQLITE_FULL:  // In the words of the system, as for files.
      return absl::ResourceExhaustedError(absl::StrCat(message, ": ", std::strerror(ENOSPC)));
    case SQLITE_CONSTRAINT: {
      const bool of_key = result == SQLITE_CONSTRAINT_PRIMARYKEY ||
                          result == SQLITE_CONSTRAINT_UNIQUE || result == SQLITE_CONSTRAINT_ROWID;
      return of_key ? absl::AlreadyExistsError(message) : absl::UnavailableError(message);
    }
    case SQLITE_PERM:
    case SQLITE_READONLY:
      return absl::PermissionDeniedError(message);
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return absl::DataLossError(message);
    case SQLITE_INTERRUPT:
      return absl::DeadlineExceededError(message);
    default:
      return absl::UnavailableError(message);
  }
}

}  // namespace

SqliteStatement::SqliteStatement(sqlite3* database, sqlite3_stmt* statement, absl::Status prepared)
    : database_(database), statement_(statement), status_(std::move(prepared)) {}

SqliteStatement::SqliteStatement(SqliteStatement&& other) noexcept
    : database_(other.database_),
      statement_(std::exchange(other.statement_, nullptr)),
      status_(other.status_),
      bound_count_(other.bound_count_),
      stepped_(other.stepped_) {}

SqliteStatement::~SqliteStatement() { sqlite3_finalize(statement_); }

void SqliteStatement::Rewind() {
  if (!stepped_) return;
  sqlite3_reset(statement_);
  sqlite3_clear_bindings(statement_);
  bound_count_ = 0;
  stepped_ = false;
}

void SqliteStatement::NoteBound(int result) {
  // Binding a parameter that the statement does not have is a programming error.
  SHEAF_CHECK(result != SQLITE_RANGE);
  if (result != SQLITE_OK && status_.ok()) {
    status_ = StatusFromSqlite(result, database_);
  }
}

SqliteStatement& SqliteStatement::Bind(int64_t value) {
  if (statement_ == nullptr) return *this;
  Rewind();
  NoteBound(sqlite3_bind_int64(statement_, ++bound_count_, value));
  return *this;
}

SqliteStatement& SqliteStatement::Bind(double value) {
  if (statement_ == nullptr) return *this;
  Rewind();
  NoteBound(sqlite3_bind_double(statement_, ++bound_count_, value));
  return *this;
}

SqliteStatement& SqliteStatement::Bind(const std::string& value) {
  if (statement_ == nullptr) return *this;
  Rewind();
  NoteBound(sqlite3_bind_text64(statement_, ++bound_count_, value.data(), value.size(),
                                SQLITE_TRANSIENT, SQLITE_UTF8));
  return *this;
}

SqliteStatement& SqliteStatement::BindBytes(std::string_view bytes) {
  if (statement_ == nullptr) return *this;
  Rewind();
  NoteBound(sqlite3_bind_blob64(statement_, ++bound_count_, bytes.data(), bytes.size(),
                                SQLITE_TRANSIENT));
  return *this;
}

absl::StatusOr<bool> SqliteStatement::Step() {
  if (!status_.ok()) return status_;
  stepped_ = true;
  const int result = sqlite3_step(statement_);
  if (result == SQLITE_ROW) return true;
  if (result == SQLITE_DONE) return false;
  absl::Status status = StatusFromSqlite(result, database_);
  sqlite3_reset(statement_);
  return status;
}

absl::Status SqliteStatement::Run() {
  while (true) {
    const absl::StatusOr<bool> row = Step();
    if (!row.ok()) return row.status();
    if (!*row) break;
  }
  sqlite3_reset(statement_);
  return absl::OkStatus();
}

int64_t SqliteStatement::Int64(int column) const {
  return sqlite3_column_int64(statement_, column);
}

double SqliteStatement::Double(int column) const {
  return sqlite3_column_double(statement_, column);
}

std::string SqliteStatement::Text(int column) const {
  const unsigned char* text = sqlite3_column_text(statement_, column);
  if (text == nullptr) return "";
  return {reinterpret_cast<const char*>(text),
          static_cast<size_t>(sqlite3_column_bytes(statement_, column))};
}

std::string SqliteStatement::Bytes(int column) const {
  const void* bytes = sqlite3_column_blob(statement_, column);
  if (bytes == nullptr) return "";
  return {static_cast<const char*>(bytes),
          static_cast<size_t>(sqlite3_column_bytes(statement_, column))};
}

absl::StatusOr<std::unique_ptr<SqliteDatabase>> SqliteDatabase::Open(const std::string& path,
                                                                     Durability durability) {
  const int64_t lost_commits = CountLostCommits(path + "-wal");
  sqlite3* handle = nullptr;
  const int result =
      sqlite3_open_v2(path.c_str(), &handle,
                      SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_FULLMUTEX, nullptr);
  std::unique_ptr<SqliteDatabase> database(new SqliteDatabase(handle, lost_commits));
  if (result != SQLITE_OK) {
    const std::string why = handle == nullptr ? sqlite3_errstr(result) : sqlite3_errmsg(handle);
    return absl::UnavailableError(absl::StrCat(path, ": ", why));
  }
  sqlite3_extended_result_codes(handle, 1);
  sqlite3_busy_timeout(handle, kBusyTimeoutMs);
  absl::Status status = database->Execute(
      absl::StrCat("PRAGMA journal_mode=WAL; PRAGMA foreign_keys=ON; PRAGMA synchronous=",
                   durability == Durability::kPowerLoss ? "FULL" : "OFF", ";"));
  if (!status.ok()) return status;
  return database;
}

SqliteDatabase::~SqliteDatabase() { sqlite3_close(database_); }

absl::Status SqliteDatabase::Execute(const std::string& sql) {
  const int result = sqlite3_exec(database_, sql.c_str(), nullptr, nullptr, nullptr);
  return result == SQLITE_OK ? absl::OkStatus() : StatusFromSqlite(result, database_);
}

SqliteStatement SqliteDatabase::Prepare(const std::string& sql) {
  sqlite3_stmt* statement = nullptr;
  const int result =
      sqlite3_prepare_v2(database_, sql.c_str(), static_cast<int>(sql.size()), &statement, nullptr);
  return {database_, statement,
          result == SQLITE_OK ? absl::OkStatus() : StatusFromSqlite(result, database_)};
}

absl::Status SqliteDatabase::Check(absl::Duration time_max) {
  SteadyTime end = SteadyTime::Now() + time_max;
  const auto late = [](void* deadline) {
    return SteadyTime::Now() < *static_cast<SteadyTime*>(deadline) ? 0 : 1;
  };
  sqlite3_progress_handler(database_, kCheckSteps, late, &end);
  SqliteStatement check = Prepare("PRAGMA quick_check(1)");
  const absl::StatusOr<bool> row = check.Step();
  sqlite3_progress_handler(database_, 0, nullptr, nullptr);
  if (!row.ok()) return absl::IsDeadlineExceeded(row.status()) ? absl::OkStatus() : row.status();
  const std::string found = check.Text(0);
  return found == "ok" ? absl::OkStatus()
                       : absl::DataLossError(absl::StrReplaceAll(found, {{"\n", " "}}));
}

}  // namespace sheaf::coordinator
