// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/server/shared_database.h"

#include <cstdlib>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/base/surroundings/host_name.h"
#include "coordinator/store/database/postgres_database.h"

namespace sheaf::coordinator {
namespace {

std::string NameOf(const std::string& listen_address) {
  return absl::StrCat(listen_address, " on ", HostName());
}

// Ends the process at once: it must not continue with a state that is no longer the farm's. A
// result that it acknowledged is stored.
[[noreturn]] void StopDeposed(const absl::Status& why) {
  LogError(absl::StrCat(why.message(),
                        "; this coordinator stops. All that it acknowledged is stored, and workers "
                        "and clients that know the other address follow. Start it again to stand "
                        "by"));
  std::_Exit(EXIT_FAILURE);
}

}  // namespace

absl::StatusOr<OwnedFarm> OwnFarm(const SharedDatabaseOptions& options,
                                  const std::function<bool(absl::Duration)>& sleep) {
  const auto standing_by = [&options](const std::string& owner) {
    const std::string words =
        absl::StrCat("standing by: the coordinator ", owner, " owns the farm");
    LogInfo(words);
    if (options.standing_by) options.standing_by(words);
  };
  OwnedFarm farm;
  absl::StatusOr<std::unique_ptr<FarmOwnership>> ownership = FarmOwnership::Acquire(
      {options.url, NameOf(options.listen_address), options.silence_max, sleep, standing_by});
  if (!ownership.ok()) return ownership.status();
  farm.ownership = *std::move(ownership);
  farm.ownership->Keep(StopDeposed);
  LogInfo(absl::StrCat("owns the farm, under epoch ", farm.ownership->epoch()));
  absl::StatusOr<std::unique_ptr<PostgresDatabase>> database = PostgresDatabase::Open(
      options.url, kJobsSchema, WriteFence{farm.ownership->epoch(), StopDeposed});
  if (!database.ok()) return database.status();
  farm.database = *std::move(database);
  return farm;
}

}  // namespace sheaf::coordinator
