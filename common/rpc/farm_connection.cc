// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/farm_connection.h"

#include "absl/strings/str_cat.h"
#include "common/base/log.h"
#include "common/rpc/address.h"
#include "common/rpc/channel.h"
#include "common/rpc/tls_credentials.h"

namespace sheaf {

std::shared_ptr<grpc::Channel> FarmConnection::Open() const {
  return MakeChannel(address, files ? MutualTlsCredentials(*files) : nullptr);
}

FarmConnection ConnectionTo(const std::string& address, const CredentialStore& store) {
  FarmConnection connection{address, store.Find(address)};
  const absl::StatusOr<Address> parsed = ParseAddress(address);
  if (!connection.files && parsed.ok() && !IsLoopback(*parsed)) {
    LogWarning(absl::StrCat("there are no credentials for ", address,
                            ": the connection is neither encrypted nor authenticated"));
  }
  return connection;
}

}  // namespace sheaf
