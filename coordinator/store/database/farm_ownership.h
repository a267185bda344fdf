// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmOwnership: which of the coordinators that share a PostgreSQL database owns the farm. The
// owner renews a lease in the database; if it lapses, another coordinator takes the farm over,
// under the next epoch. Times are those of the database's clock. The epoch, which each transaction
// checks (postgres_database.h), protects the farm's rows, not the lease: an owner whose lease has
// lapsed continues until another one has taken over (docs/adr/0082).
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <thread>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "coordinator/store/database/postgres_connection.h"

namespace sheaf::coordinator {

// How long an owner may be silent before another coordinator takes over. It renews its lease four
// times as often.
inline constexpr absl::Duration kOwnerSilenceMax = absl::Seconds(2);
// How often a coordinator that stands by looks at the lease.
inline constexpr absl::Duration kStandbyInterval = absl::Milliseconds(200);

// Thread safety: one thread at a time.
class FarmOwnership {
 public:
  struct Options {
    std::string url;   // The database's URL.
    std::string name;  // This coordinator's name for others, e.g. "host:port".
    absl::Duration silence_max = kOwnerSilenceMax;
    // Sleeps; false: the caller wants to stop waiting.
    std::function<bool(absl::Duration)> sleep = {};
    // Called once if another coordinator owns the farm, with its name.
    std::function<void(const std::string& owner)> standing_by = {};
  };
  // Returns when this coordinator owns the farm. Errors: kCancelled (sleep returned false); those
  // of PostgresConnection::Open at the first attempt to connect.
  static absl::StatusOr<std::unique_ptr<FarmOwnership>> Acquire(const Options& options);
  // Stops renewing and lets another one take over at once.
  ~FarmOwnership();
  FarmOwnership(const FarmOwnership&) = delete;
  FarmOwnership& operator=(const FarmOwnership&) = delete;

  int64_t epoch() const { return epoch_; }
  // Renews the lease from now on, in a thread of its own. deposed: called there, once, if another
  // coordinator has taken over, with a message for operators.
  void Keep(std::function<void(const absl::Status& why)> deposed);

 private:
  FarmOwnership(std::unique_ptr<PostgresConnection> connection, absl::Duration silence_max)
      : connection_(std::move(connection)), silence_max_(silence_max) {}
  absl::Status MakeTables();
  // Returns true if the farm was free and is now this coordinator's; otherwise sets *owner.
  absl::StatusOr<bool> TryToTake(const std::string& name, std::string* owner);
  absl::Status Take(const std::string& name, bool* taken);
  // kAborted if another one owns the farm.
  absl::Status Renew();
  std::string Lease() const;  // "clock_timestamp() + ...".

  const std::unique_ptr<PostgresConnection> connection_;
  const absl::Duration silence_max_;
  int64_t epoch_ = 0;
  std::jthread renewals_;
};

}  // namespace sheaf::coordinator
