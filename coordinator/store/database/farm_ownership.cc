// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/database/farm_ownership.h"

#include <stop_token>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/mutex.h"

namespace sheaf::coordinator {
namespace {

constexpr int kRenewalsPerLease = 4;
// How long to wait for a server that restarts; a failed renewal is retried anyway.
constexpr absl::Duration kReconnectWait = absl::ZeroDuration();
constexpr int64_t kTablesLock = 0x53484f574e;

// One row each. A transaction of jobs holds the row of `owner`, so that a lease can be renewed
// meanwhile.
constexpr char kTables[] = R"sql(
CREATE SCHEMA IF NOT EXISTS sheaf_owner;
CREATE TABLE IF NOT EXISTS sheaf_owner.owner(
  epoch BIGINT NOT NULL, transaction_number BIGINT NOT NULL);
CREATE TABLE IF NOT EXISTS sheaf_owner.lease(
  epoch BIGINT NOT NULL, name TEXT NOT NULL, expire_time TIMESTAMPTZ NOT NULL);
INSERT INTO sheaf_owner.owner SELECT 0, 0 WHERE NOT EXISTS (SELECT 1 FROM sheaf_owner.owner);
INSERT INTO sheaf_owner.lease SELECT 0, '', '-infinity'
  WHERE NOT EXISTS (SELECT 1 FROM sheaf_owner.lease);
)sql";

}  // namespace

absl::StatusOr<std::unique_ptr<FarmOwnership>> FarmOwnership::Acquire(const Options& options) {
  // A lease lost in a crash of the server lapses, which is safe.
  absl::StatusOr<std::unique_ptr<PostgresConnection>> connection =
      PostgresConnection::Open(options.url, "SET synchronous_commit TO off");
  if (!connection.ok()) return connection.status();
  std::unique_ptr<FarmOwnership> ownership(
      new FarmOwnership(*std::move(connection), options.silence_max));
  if (absl::Status status = ownership->MakeTables(); !status.ok()) return status;
  bool told = false;
  while (true) {
    std::string owner;
    const absl::StatusOr<bool> taken = ownership->TryToTake(options.name, &owner);
    if (taken.ok() && *taken) return ownership;
    // A server that restarts is asked again.
    if (!taken.ok() && !ownership->connection_->IsLost()) return taken.status();
    if (taken.ok() && !std::exchange(told, true) && options.standing_by) {
      options.standing_by(owner);
    }
    if (!options.sleep(kStandbyInterval)) return absl::CancelledError("stopped while standing by");
    if (ownership->connection_->IsLost()) {
      ownership->connection_->Reconnect(kReconnectWait).IgnoreError();
    }
  }
}

FarmOwnership::~FarmOwnership() {
  renewals_.request_stop();
  if (renewals_.joinable()) renewals_.join();
  if (epoch_ == 0 || connection_->IsLost()) return;
  connection_
      ->Run(absl::StrCat("UPDATE sheaf_owner.lease SET expire_time = '-infinity' WHERE epoch = ",
                         epoch_))
      .status()
      .IgnoreError();
}

std::string FarmOwnership::Lease() const {
  return absl::StrCat("clock_timestamp() + interval '", absl::ToInt64Milliseconds(silence_max_),
                      " milliseconds'");
}

absl::Status FarmOwnership::MakeTables() {
  // A user of the tables may not always make them.
  const absl::StatusOr<PostgresResult> there =
      connection_->Run("SELECT 1 WHERE to_regclass('sheaf_owner.lease') IS NOT NULL");
  if (!there.ok()) return there.status();
  if (there->RowCount() == 1) return absl::OkStatus();
  return connection_
      ->Run(
          absl::StrCat("BEGIN;SELECT pg_advisory_xact_lock(", kTablesLock, ");", kTables, "COMMIT"))
      .status();
}

absl::StatusOr<bool> FarmOwnership::TryToTake(const std::string& name, std::string* owner) {
  const absl::StatusOr<PostgresResult> lease = connection_->Run(
      "SELECT name, CAST(expire_time > clock_timestamp() AS INTEGER) FROM sheaf_owner.lease");
  if (!lease.ok()) return lease.status();
  if (lease->RowCount() != 1) {
    return absl::DataLossError(
        absl::StrCat(connection_->Name(), ": sheaf_owner.lease has ", lease->RowCount(),
                     " rows instead of one; restore the database from a backup"));
  }
  *owner = lease->Text(0, 0);
  if (lease->Int64(0, 1) != 0) return false;
  bool taken = false;
  if (absl::Status status = Take(name, &taken); !status.ok()) {
    if (!connection_->IsLost()) connection_->Run("ROLLBACK").status().IgnoreError();
    return status;
  }
  return taken;
}

absl::Status FarmOwnership::Take(const std::string& name, bool* taken) {
  absl::Status status = connection_->Run("BEGIN;SET LOCAL synchronous_commit TO on").status();
  if (!status.ok()) return status;
  // Several waiting coordinators change the row one after the other, and only the first finds it
  // lapsed.
  const absl::StatusOr<PostgresResult> lease = connection_->Run(
      absl::StrCat("UPDATE sheaf_owner.lease SET epoch = epoch + 1, name = $1, expire_time = ",
                   Lease(), " WHERE expire_time <= clock_timestamp() RETURNING epoch"),
      {PostgresText(name)});
  if (!lease.ok()) return lease.status();
  if (lease->RowCount() == 0) return connection_->Run("ROLLBACK").status();
  const int64_t epoch = lease->Int64(0, 0);
  // Waits for a transaction of the previous owner. That may take a while, so the lease is renewed.
  status = connection_
               ->Run(absl::StrCat("UPDATE sheaf_owner.owner SET epoch = ", epoch,
                                  ", transaction_number = 0;"
                                  "UPDATE sheaf_owner.lease SET expire_time = ",
                                  Lease(), ";COMMIT"))
               .status();
  if (!status.ok()) return status;
  epoch_ = epoch;
  *taken = true;
  return absl::OkStatus();
}

absl::Status FarmOwnership::Renew() {
  if (connection_->IsLost()) {
    if (absl::Status status = connection_->Reconnect(kReconnectWait); !status.ok()) return status;
  }
  const absl::StatusOr<PostgresResult> renewed = connection_->Run(absl::StrCat(
      "UPDATE sheaf_owner.lease SET expire_time = ", Lease(), " WHERE epoch = ", epoch_));
  if (!renewed.ok()) return renewed.status();
  if (renewed->ChangedRows() == 1) return absl::OkStatus();
  const absl::StatusOr<PostgresResult> lease =
      connection_->Run("SELECT name, epoch FROM sheaf_owner.lease");
  if (!lease.ok()) return lease.status();
  const bool there = lease->RowCount() == 1;
  return absl::AbortedError(absl::StrCat("the coordinator ", there ? lease->Text(0, 0) : "?",
                                         " has taken the farm over, under epoch ",
                                         there ? lease->Int64(0, 1) : 0, " after ", epoch_));
}

void FarmOwnership::Keep(std::function<void(const absl::Status& why)> deposed) {
  renewals_ = std::jthread([this, deposed = std::move(deposed)](const std::stop_token& stop) {
    bool warned = false;
    do {
      const absl::Status renewed = Renew();
      if (absl::IsAborted(renewed)) {
        deposed(renewed);
        return;
      }
      if (!renewed.ok() && !std::exchange(warned, true)) {
        LogWarning(
            absl::StrCat("the ownership of the farm cannot be renewed: ", renewed.message()));
      }
      if (renewed.ok() && std::exchange(warned, false)) {
        LogInfo("the ownership of the farm is renewed again");
      }
    } while (SleepUnlessStopped(silence_max_ / kRenewalsPerLease, stop));
  });
}

}  // namespace sheaf::coordinator
