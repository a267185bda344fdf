// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The channel of a command to its coordinator: with the credentials of the person who runs it, if
// sheaf login has stored any for the address.
#pragma once

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace sheaf::cli {

// Renews the certificate on the way when half of its life is over. Errors: kUnauthenticated: the
// certificate has ended; the message says how to log in again.
absl::StatusOr<std::shared_ptr<grpc::Channel>> OpenFarmChannel(const std::string& coordinator);

}  // namespace sheaf::cli
