// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The channel of a command to its coordinator: with the credentials of the user who runs it, if
// sheaf login has stored any for the address.
#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "common/rpc/address.h"

namespace sheaf::cli {

// The coordinator that a command calls.
struct FarmAddress {
  std::string address = kCoordinatorAddress;
  bool insecure = false;  // May be reached in plain text on another machine.
};

// Also renews the certificate when half of its lifetime is over. Errors: those of ConnectionTo;
// kUnauthenticated: the certificate has ended; the message says how to log in again.
absl::StatusOr<std::shared_ptr<grpc::Channel>> OpenFarmChannel(const FarmAddress& coordinator);

}  // namespace sheaf::cli
