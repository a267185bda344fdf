// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/database/postgres_database.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "common/base/check.h"
#include "common/base/log.h"
#include "coordinator/store/database/postgres_sql.h"

namespace sheaf::coordinator {
namespace {

// How long a call waits for a server that restarts.
constexpr absl::Duration kReconnectWaitMax = absl::Seconds(2);
// How long to look for the outcome of an interrupted commit: a server that crashed recovers first.
constexpr absl::Duration kOutcomeWaitMax = absl::Seconds(60);
// A coordinator that hangs within a transaction must not keep others from taking over.
constexpr char kIdleTransactionMax[] = "2s";
// Processes that make a schema at the same time wait for each other by this lock.
constexpr int64_t kSchemaLock = 0x5348454146;

class PostgresStatement : public PreparedStatement {
 public:
  PostgresStatement(PostgresDatabase* database, const std::string& sql)
      : database_(*database), sql_(PostgresParameters(sql)) {}

  void BindInt64(int parameter, int64_t value) override { Set(parameter, PostgresInt64(value)); }
  void BindDouble(int parameter, double value) override { Set(parameter, PostgresDouble(value)); }
  void BindText(int parameter, std::string_view text) override {
    Set(parameter, PostgresText(text));
  }
  void BindBytes(int parameter, std::string_view bytes) override {
    Set(parameter, PostgresBytes(bytes));
  }

  absl::StatusOr<bool> Step() override {
    if (!result_) {
      absl::StatusOr<PostgresResult> result = database_.Run(sql_, values_);
      if (!result.ok()) return result.status();
      result_ = *std::move(result);
      row_ = -1;
    }
    return ++row_ < result_->RowCount();
  }
  void Reset() override { result_.reset(); }
  void ClearParameters() override { values_.clear(); }

  int64_t Int64(int column) const override { return result_->Int64(row_, column); }
  double Double(int column) const override { return result_->Double(row_, column); }
  std::string Text(int column) const override { return result_->Text(row_, column); }
  std::string Bytes(int column) const override { return result_->Text(row_, column); }

 private:
  void Set(int parameter, PostgresValue value) {
    const auto count = static_cast<size_t>(parameter);
    if (values_.size() < count) values_.resize(count);
    values_[count - 1] = std::move(value);
  }

  PostgresDatabase& database_;
  const std::string sql_;
  std::vector<PostgresValue> values_;
  std::optional<PostgresResult> result_;
  int row_ = -1;
};

}  // namespace

absl::StatusOr<std::unique_ptr<PostgresDatabase>> PostgresDatabase::Open(
    const std::string& url, const std::string& schema, std::optional<WriteFence> fence,
    Durability durability) {
  const std::string settings =
      absl::StrCat("SET search_path TO ", schema, ";SET synchronous_commit TO ",
                   durability == Durability::kPowerLoss ? "on" : "off",
                   ";SET idle_in_transaction_session_timeout TO '", kIdleTransactionMax, "'");
  absl::StatusOr<std::unique_ptr<PostgresConnection>> connection =
      PostgresConnection::Open(url, settings);
  if (!connection.ok()) return connection.status();
  std::unique_ptr<PostgresDatabase> database(
      new PostgresDatabase(*std::move(connection), std::move(fence)));
  if (absl::Status status = database->MakeSchema(schema); !status.ok()) return status;
  return database;
}

absl::Status PostgresDatabase::MakeSchema(const std::string& schema) {
  // A user of a schema may not always make one.
  const absl::StatusOr<PostgresResult> there = connection_->Run(
      absl::StrCat("SELECT 1 WHERE to_regclass('", schema, ".schema_version') IS NOT NULL"));
  if (!there.ok()) return there.status();
  if (there->RowCount() == 1) return absl::OkStatus();
  return connection_
      ->Run(absl::StrCat("BEGIN;SELECT pg_advisory_xact_lock(", kSchemaLock,
                         ");CREATE SCHEMA IF NOT EXISTS ", schema, ";CREATE TABLE IF NOT EXISTS ",
                         schema, ".schema_version(version BIGINT NOT NULL);COMMIT"))
      .status();
}

Statement PostgresDatabase::Prepare(const std::string& sql) {
  return Statement(std::make_unique<PostgresStatement>(this, sql));
}

absl::StatusOr<PostgresResult> PostgresDatabase::WithReconnect(
    const std::function<absl::StatusOr<PostgresResult>()>& run) {
  if (!connection_->IsLost()) {
    absl::StatusOr<PostgresResult> result = run();
    if (result.ok() || !connection_->IsLost()) return result;
  }
  if (absl::Status status = connection_->Reconnect(kReconnectWaitMax); !status.ok()) return status;
  return run();
}

absl::StatusOr<PostgresResult> PostgresDatabase::InOwnTransaction(
    const std::function<absl::StatusOr<PostgresResult>()>& run) {
  absl::StatusOr<PostgresResult> result;
  const absl::Status status = InTransaction([&] {
    result = run();
    return result.status();
  });
  if (!status.ok()) return status;
  return result;
}

absl::StatusOr<PostgresResult> PostgresDatabase::Run(const std::string& sql,
                                                     const std::vector<PostgresValue>& values) {
  const auto run = [&] { return connection_->Run(sql, values); };
  absl::StatusOr<PostgresResult> result = in_transaction_ ? run()
                                          : IsQuery(sql)  ? WithReconnect(run)
                                                          : InOwnTransaction(run);
  if (result.ok()) changed_rows_ = result->ChangedRows();
  return result;
}

absl::Status PostgresDatabase::Execute(const std::string& sql) {
  const auto run = [&] { return connection_->Run(PostgresScript(sql)); };
  return (in_transaction_ ? run() : InOwnTransaction(run)).status();
}

absl::Status PostgresDatabase::Begin() {
  SHEAF_CHECK(!in_transaction_);
  std::string sql = "BEGIN";
  if (fence_) {
    absl::StrAppend(&sql,
                    ";UPDATE sheaf_owner.owner SET transaction_number = ", ++transaction_number_,
                    " WHERE epoch = ", fence_->epoch);
  }
  const absl::StatusOr<PostgresResult> begun = WithReconnect([&] { return connection_->Run(sql); });
  if (!begun.ok()) {
    Rollback();
    return begun.status();
  }
  if (fence_ && begun->ChangedRows() == 0) {
    Rollback();
    return Lost(absl::AbortedError("another coordinator has taken the farm over"));
  }
  in_transaction_ = true;
  return absl::OkStatus();
}

absl::Status PostgresDatabase::Commit() {
  const absl::StatusOr<PostgresResult> done = connection_->Run("COMMIT");
  in_transaction_ = false;
  if (!done.ok()) return connection_->IsLost() && fence_ ? FindOutcome() : done.status();
  // After an error within the transaction COMMIT undoes it, without an error.
  if (done->Command() == "COMMIT") return absl::OkStatus();
  return absl::UnavailableError(absl::StrCat(Name(), ": the transaction was undone"));
}

void PostgresDatabase::Rollback() {
  in_transaction_ = false;
  // A lost connection has ended its transaction.
  if (!connection_->IsLost()) connection_->Run("ROLLBACK").status().IgnoreError();
}

absl::Status PostgresDatabase::FindOutcome() {
  LogWarning(absl::StrCat(Name(),
                          ": the connection was lost during a commit; asking whether it "
                          "succeeded"));
  if (absl::Status status = connection_->Reconnect(kOutcomeWaitMax); !status.ok()) {
    return Lost(absl::UnavailableError(
        absl::StrCat("it is not known whether a change was stored: ", status.message())));
  }
  // Waits for the transaction, if the server has not yet noticed that its connection is lost.
  const absl::StatusOr<PostgresResult> owner =
      connection_->Run("SELECT epoch, transaction_number FROM sheaf_owner.owner FOR UPDATE");
  if (!owner.ok() || owner->RowCount() != 1) {
    return Lost(absl::UnavailableError("it is not known whether a change was stored"));
  }
  if (owner->Int64(0, 0) != fence_->epoch) {
    return Lost(absl::AbortedError("another coordinator has taken the farm over"));
  }
  if (owner->Int64(0, 1) == transaction_number_) return absl::OkStatus();
  return absl::UnavailableError(
      absl::StrCat(Name(), ": the connection was lost before a change was stored"));
}

absl::Status PostgresDatabase::Lost(absl::Status why) const {
  if (fence_->lost) fence_->lost(why);
  return why;
}

absl::StatusOr<int64_t> PostgresDatabase::SchemaVersion() {
  const absl::StatusOr<PostgresResult> version = Run("SELECT version FROM schema_version", {});
  if (!version.ok()) return version.status();
  return version->RowCount() == 0 ? 0 : version->Int64(0, 0);
}

absl::Status PostgresDatabase::SetSchemaVersion(int64_t version) {
  return Execute(
      absl::StrCat("DELETE FROM schema_version;INSERT INTO schema_version VALUES(", version, ")"));
}

absl::StatusOr<std::set<std::string>> PostgresDatabase::TableColumns() {
  const absl::StatusOr<PostgresResult> rows =
      Run("SELECT CAST(table_name || '.' || column_name AS TEXT) FROM information_schema.columns "
          "WHERE table_schema = current_schema() AND table_name <> 'schema_version'",
          {});
  if (!rows.ok()) return rows.status();
  std::set<std::string> columns;
  for (int row = 0; row < rows->RowCount(); ++row) columns.insert(rows->Text(row, 0));
  return columns;
}

std::string PostgresDatabase::Remedy(const std::string& state_directory) const {
  return absl::StrCat(
      "Stop the coordinators and keep a copy of the database. Then restore it from a backup, or "
      "move ",
      state_directory,
      " away, start again with an empty database and submit the unfinished scenes "
      "again; finished images are in ",
      state_directory, "/outputs in any case");
}

}  // namespace sheaf::coordinator
