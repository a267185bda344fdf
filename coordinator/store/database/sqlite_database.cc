// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/database/sqlite_database.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "common/base/check.h"
#include "common/base/steady_time.h"
#include "coordinator/store/database/lost_commits.h"

namespace sheaf::coordinator {
namespace {

constexpr int kBusyTimeoutMs = 5000;
constexpr char kInMemory[] = ":memory:";  // No file.
// SQLite's virtual machine runs this many steps between checks of the time: well below a
// millisecond.
constexpr int kCheckSteps = 1000;

absl::Status StatusFromSqlite(int result, sqlite3* database) {
  const char* path = sqlite3_db_filename(database, "main");
  const std::string message =
      absl::StrCat(path == nullptr ? "database" : path, ": ", sqlite3_errmsg(database));
  switch (result & 0xff) {
    case SQLITE_FULL:  // With the system's message, as for files.
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

class SqliteStatement : public PreparedStatement {
 public:
  // statement: null if `prepared` is an error.
  SqliteStatement(sqlite3* database, sqlite3_stmt* statement, absl::Status prepared)
      : database_(database), statement_(statement), status_(std::move(prepared)) {}
  ~SqliteStatement() override { sqlite3_finalize(statement_); }
  SqliteStatement(const SqliteStatement&) = delete;
  SqliteStatement& operator=(const SqliteStatement&) = delete;

  void BindInt64(int parameter, int64_t value) override {
    if (statement_ != nullptr) NoteBound(sqlite3_bind_int64(statement_, parameter, value));
  }
  void BindDouble(int parameter, double value) override {
    if (statement_ != nullptr) NoteBound(sqlite3_bind_double(statement_, parameter, value));
  }
  void BindText(int parameter, std::string_view text) override {
    if (statement_ == nullptr) return;
    NoteBound(sqlite3_bind_text64(statement_, parameter, text.data(), text.size(), SQLITE_TRANSIENT,
                                  SQLITE_UTF8));
  }
  void BindBytes(int parameter, std::string_view bytes) override {
    if (statement_ == nullptr) return;
    NoteBound(
        sqlite3_bind_blob64(statement_, parameter, bytes.data(), bytes.size(), SQLITE_TRANSIENT));
  }

  absl::StatusOr<bool> Step() override {
    if (!status_.ok()) return status_;
    const int result = sqlite3_step(statement_);
    if (result == SQLITE_ROW) return true;
    if (result == SQLITE_DONE) return false;
    return StatusFromSqlite(result, database_);
  }
  void Reset() override { sqlite3_reset(statement_); }
  void ClearParameters() override {
    if (statement_ != nullptr) sqlite3_clear_bindings(statement_);
  }

  int64_t Int64(int column) const override { return sqlite3_column_int64(statement_, column); }
  double Double(int column) const override { return sqlite3_column_double(statement_, column); }
  std::string Text(int column) const override {
    const unsigned char* text = sqlite3_column_text(statement_, column);
    if (text == nullptr) return "";
    return {reinterpret_cast<const char*>(text),
            static_cast<size_t>(sqlite3_column_bytes(statement_, column))};
  }
  std::string Bytes(int column) const override {
    const void* bytes = sqlite3_column_blob(statement_, column);
    if (bytes == nullptr) return "";
    return {static_cast<const char*>(bytes),
            static_cast<size_t>(sqlite3_column_bytes(statement_, column))};
  }

 private:
  void NoteBound(int result) {
    // Binding a parameter that the statement does not have is a programming error.
    SHEAF_CHECK(result != SQLITE_RANGE);
    if (result != SQLITE_OK && status_.ok()) status_ = StatusFromSqlite(result, database_);
  }

  sqlite3* database_;
  sqlite3_stmt* statement_;
  absl::Status status_;  // The status of the calls before Step.
};

// Makes the file of a new database, readable for its owner alone; SQLite gives its logs the same
// permissions. A file that exists is not opened: closing it would release SQLite's locks.
void MakePrivateFile(const std::string& path) {
  const int fd = ::open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (fd >= 0) ::close(fd);
}

}  // namespace

absl::StatusOr<std::unique_ptr<SqliteDatabase>> SqliteDatabase::Open(const std::string& path,
                                                                     Durability durability) {
  const int64_t lost_commits = CountLostCommits(path + "-wal");
  if (path != kInMemory) MakePrivateFile(path);
  sqlite3* handle = nullptr;
  const int result =
      sqlite3_open_v2(path.c_str(), &handle,
                      SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_FULLMUTEX, nullptr);
  std::unique_ptr<SqliteDatabase> database(new SqliteDatabase(path, handle, lost_commits));
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

Statement SqliteDatabase::Prepare(const std::string& sql) {
  sqlite3_stmt* statement = nullptr;
  const int result =
      sqlite3_prepare_v2(database_, sql.c_str(), static_cast<int>(sql.size()), &statement, nullptr);
  return Statement(std::make_unique<SqliteStatement>(
      database_, statement,
      result == SQLITE_OK ? absl::OkStatus() : StatusFromSqlite(result, database_)));
}

int64_t SqliteDatabase::ChangedRows() const { return sqlite3_changes(database_); }

absl::StatusOr<int64_t> SqliteDatabase::SchemaVersion() {
  Statement query = Prepare("PRAGMA user_version");
  const absl::StatusOr<bool> row = query.Step();
  if (!row.ok()) return row.status();
  return query.Int64(0);
}

absl::Status SqliteDatabase::SetSchemaVersion(int64_t version) {
  return Execute(absl::StrCat("PRAGMA user_version=", version));
}

absl::StatusOr<std::set<std::string>> SqliteDatabase::TableColumns() {
  Statement query = Prepare(
      "SELECT m.name || '.' || c.name FROM sqlite_master m JOIN pragma_table_info(m.name) c "
      "WHERE m.type = 'table' AND m.name NOT LIKE 'sqlite_%'");
  std::set<std::string> columns;
  while (true) {
    const absl::StatusOr<bool> row = query.Step();
    if (!row.ok()) return row.status();
    if (!*row) return columns;
    columns.insert(query.Text(0));
  }
}

std::string SqliteDatabase::Remedy(const std::string& state_directory) const {
  return RemedyFor(path_, state_directory);
}

std::string SqliteDatabase::RemedyFor(const std::string& path, const std::string& state_directory) {
  return absl::StrCat(
      "Stop here and keep a copy of ", state_directory, ". Then restore ", path,
      " from a backup (without its -wal and -shm files), or move ", state_directory,
      " away, start again and submit the unfinished scenes again; finished images are in ",
      state_directory,
      "/outputs in any case. If SQLite's shell has .recover (Debian 12's does not), \"sqlite3 ",
      path, " .recover | sqlite3 recovered.db\" may save more");
}

absl::Status SqliteDatabase::Check(absl::Duration time_max) {
  SteadyTime end = SteadyTime::Now() + time_max;
  const auto late = [](void* deadline) {
    return SteadyTime::Now() < *static_cast<SteadyTime*>(deadline) ? 0 : 1;
  };
  sqlite3_progress_handler(database_, kCheckSteps, late, &end);
  Statement check = Prepare("PRAGMA quick_check(1)");
  const absl::StatusOr<bool> row = check.Step();
  sqlite3_progress_handler(database_, 0, nullptr, nullptr);
  if (!row.ok()) return absl::IsDeadlineExceeded(row.status()) ? absl::OkStatus() : row.status();
  const std::string found = check.Text(0);
  return found == "ok" ? absl::OkStatus()
                       : absl::DataLossError(absl::StrReplaceAll(found, {{"\n", " "}}));
}

}  // namespace sheaf::coordinator
