// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/farm_channel.h"

#include "common/rpc/enrolment.h"
#include "common/rpc/farm_connection.h"

namespace sheaf::cli {
namespace {

constexpr double kRenewAtLifeFraction = 0.5;

}  // namespace

absl::StatusOr<std::shared_ptr<grpc::Channel>> OpenFarmChannel(const FarmAddress& coordinator) {
  const absl::StatusOr<FarmConnection> connection =
      ConnectionTo(coordinator.address, CredentialStore(CredentialStore::PersonalDirectory()),
                   coordinator.insecure);
  if (!connection.ok()) return connection.status();
  if (connection->files) {
    const absl::Status renewed =
        RenewCertificate(coordinator.address, *connection->files, kRenewAtLifeFraction).status();
    // Other errors recur, with a better message, at the command's own call.
    if (absl::IsUnauthenticated(renewed)) return renewed;
  }
  return connection->Open();
}

}  // namespace sheaf::cli
