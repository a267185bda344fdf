// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The coordinators that share a PostgreSQL database and a state directory: one owns the farm, the
// others stand by (docs/adr/0082).
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "absl/time/time.h"
#include "coordinator/store/database/database.h"
#include "coordinator/store/database/farm_ownership.h"

namespace sheaf::coordinator {

struct SharedDatabaseOptions {
  std::string url;             // postgresql://USER@HOST:PORT/DATABASE
  std::string listen_address;  // Names this coordinator, with its machine.
  absl::Duration silence_max = kOwnerSilenceMax;
  // Called once if another coordinator owns the farm, with a message for operators.
  std::function<void(const std::string& words)> standing_by = {};
};

struct OwnedFarm {
  std::unique_ptr<FarmOwnership> ownership;  // Outlives the database.
  std::unique_ptr<Database> database;        // For SqlJobStore::Open.
};

// Stands by until this coordinator owns the farm. From then on, the process ends with a message and
// exit code 1 if another coordinator takes the farm over: its state in memory is out of date.
// sleep: returns false if the caller wants to stop. Errors: kCancelled (it returned false); those
// of FarmOwnership::Acquire and PostgresDatabase::Open.
absl::StatusOr<OwnedFarm> OwnFarm(const SharedDatabaseOptions& options,
                                  const std::function<bool(absl::Duration)>& sleep);

}  // namespace sheaf::coordinator
