// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// How a program reaches a coordinator: with the credentials that a store has for its address, or
// without any.
#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "common/tls/credential_store.h"

namespace sheaf {

struct FarmConnection {
  std::string address;
  std::optional<CredentialFiles> files;  // None: neither encrypted nor authenticated.

  // Makes a channel, as MakeChannel does.
  std::shared_ptr<grpc::Channel> Open() const;
};

// Looks the address up in the store. Warns if the coordinator is on another machine and there are
// no credentials for it.
FarmConnection ConnectionTo(const std::string& address, const CredentialStore& store);

}  // namespace sheaf
