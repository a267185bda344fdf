// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Credentials of a server without TLS.
#pragma once

#include <grpcpp/security/server_credentials.h>

#include <memory>

namespace sheaf {

// Neither encrypts nor authenticates, as grpc::InsecureServerCredentials. But each call is asked
// for its version before its handler runs (CheckCaller, protocol_calls.h); gRPC's own credentials
// ask nothing without TLS.
std::shared_ptr<grpc::ServerCredentials> PlainServerCredentials();

}  // namespace sheaf
