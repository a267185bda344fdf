// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PostgresDatabase: a database on a PostgreSQL server, in a schema (name space) of its own. If
// several coordinators share it, each transaction checks inside itself that its coordinator owns
// the farm (docs/adr/0082): it writes its number into the owner's row, if that still has its epoch.
// So another coordinator cannot take over before the transaction has ended, and no transaction
// begins afterwards. If the connection is lost during a commit, the number tells whether the commit
// succeeded.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/store/database/database.h"
#include "coordinator/store/database/durability.h"
#include "coordinator/store/database/postgres_connection.h"

namespace sheaf::coordinator {

// The right to write that an owner has (farm_ownership.h).
struct WriteFence {
  int64_t epoch = 0;
  // Called if the right is lost, or if it stays unknown whether a change was stored: the process
  // must not continue with its state in memory.
  std::function<void(const absl::Status& why)> lost;
};

// The schema (name space) of the tables of jobs.
inline constexpr char kJobsSchema[] = "sheaf_jobs";

// Thread safety: one thread at a time.
class PostgresDatabase : public Database {
 public:
  // Creates the schema if it does not exist. fence: none if every process may write. Errors: those
  // of PostgresConnection::Open.
  static absl::StatusOr<std::unique_ptr<PostgresDatabase>> Open(
      const std::string& url, const std::string& schema, std::optional<WriteFence> fence = {},
      Durability durability = Durability::kPowerLoss);

  std::string Name() const override { return connection_->Name(); }
  absl::Status Execute(const std::string& sql) override;
  Statement Prepare(const std::string& sql) override;
  int64_t ChangedRows() const override { return changed_rows_; }
  absl::StatusOr<int64_t> SchemaVersion() override;
  absl::Status SetSchemaVersion(int64_t version) override;
  absl::StatusOr<std::set<std::string>> TableColumns() override;
  // The server has checksums of its own.
  absl::Status Check(absl::Duration /*time_max*/) override { return absl::OkStatus(); }
  std::string Remedy(const std::string& state_directory) const override;

  // Runs one statement in PostgreSQL's SQL; in a transaction of its own if there is none and it
  // changes something.
  absl::StatusOr<PostgresResult> Run(const std::string& sql,
                                     const std::vector<PostgresValue>& values);

 protected:
  absl::Status Begin() override;
  absl::Status Commit() override;
  void Rollback() override;

 private:
  PostgresDatabase(std::unique_ptr<PostgresConnection> connection, std::optional<WriteFence> fence)
      : connection_(std::move(connection)), fence_(std::move(fence)) {}
  absl::Status MakeSchema(const std::string& schema);
  // Runs `run`, and once more on a new connection if the connection is lost.
  absl::StatusOr<PostgresResult> WithReconnect(
      const std::function<absl::StatusOr<PostgresResult>()>& run);
  absl::StatusOr<PostgresResult> InOwnTransaction(
      const std::function<absl::StatusOr<PostgresResult>()>& run);
  // Whether the transaction whose commit was interrupted is stored.
  absl::Status FindOutcome();
  absl::Status Lost(absl::Status why) const;

  const std::unique_ptr<PostgresConnection> connection_;
  const std::optional<WriteFence> fence_;
  int64_t transaction_number_ = 0;  // Last transaction of this epoch.
  int64_t changed_rows_ = 0;
  bool in_transaction_ = false;
};

}  // namespace sheaf::coordinator
