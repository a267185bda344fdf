// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The versions of the protocol in calls of gRPC. A client sends its own with every call
// (MakeChannel sets this up), a server answers with its own, and each side compares in one place: a
// server before the handler (CheckCaller, called by CallGate and PlainServerCredentials), a client
// when the answer arrives. So a program refuses another whichever of the two is older.
#pragma once

#include <grpcpp/server_builder.h>
#include <grpcpp/support/client_interceptor.h>
#include <grpcpp/support/server_interceptor.h>

#include <map>
#include <memory>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "common/rpc/protocol_version.h"

namespace sheaf {

using CallMetadata = std::multimap<grpc::string_ref, grpc::string_ref>;

// For channels: adds `ours` to every call, and ends calls with the error of AgreeOnProtocol where
// the server's answer says versions that do not fit, or where it answers without any and `ours`
// begins after version 1.
std::vector<std::unique_ptr<grpc::experimental::ClientInterceptorFactoryInterface>>
ProtocolOfClient(const ProtocolRange& ours = kProtocol);

// For servers: adds `ours` to every answer.
std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> ProtocolOfServer(
    const ProtocolRange& ours = kProtocol);

// The version to speak with a caller. Errors: those of AgreeOnProtocol and ParseProtocol.
absl::StatusOr<int> ProtocolOfCaller(const CallMetadata& metadata,
                                     const ProtocolRange& ours = kProtocol);

// Whether the server may take the call. operation: "/sheaf.v1.WorkerService/Synchronize"; other
// services than Sheaf's, as health checks, have no versions. said: the value of kProtocolKey, or
// empty. Errors: those of ProtocolOfCaller.
absl::Status CheckCaller(std::string_view operation, std::string_view said,
                         const ProtocolRange& ours = kProtocol);

}  // namespace sheaf
