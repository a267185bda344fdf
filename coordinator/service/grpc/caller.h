// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Who makes a call, as its transport proves it.
#pragma once

#include <grpcpp/server_context.h>

#include <string>

namespace sheaf::coordinator {

// The common name of the caller's certificate; empty where the connection has none.
std::string CallerIdentity(const grpc::ServerContext& context);

}  // namespace sheaf::coordinator
