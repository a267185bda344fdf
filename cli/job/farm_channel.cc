// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/farm_channel.h"

#include "common/rpc/enrolment.h"
#include "common/rpc/farm_connection.h"

namespace sheaf::cli {
namespace {

constexpr double kRenewAtLifeFraction = 0.5;

}  // namespace

absl::StatusOr<std::shared_ptr<grpc::Channel>> OpenFarmChannel(const std::string& coordinator) {
  const FarmConnection connection =
      ConnectionTo(coordinator, CredentialStore(CredentialStore::PersonalDirectory()));
  if (connection.files) {
    const absl::Status renewed =
        RenewCertificate(coordinator, *connection.files, kRenewAtLifeFraction).status();
    // Other errors come again, with better words, at the command's own call.
    if (absl::IsUnauthenticated(renewed)) return renewed;
  }
  return connection.Open();
}

}  // namespace sheaf::cli
