// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CallTimer: has gRPC tell how long each call took, from the moment that its handler may begin to
// the sending of its status. Calls that CallGate refuses never come to it.
#pragma once

#include <grpcpp/server_builder.h>

#include "coordinator/service/view/call_times.h"

namespace sheaf::coordinator {

// Notes calls of all services of the server as "WorkerService/Synchronize" with a code as
// "NOT_FOUND"; streams too, with their whole length. Has answers say the version of the protocol
// (protocol_calls.h). times must outlive the server.
void TimeCalls(CallTimes* times, grpc::ServerBuilder* builder);

}  // namespace sheaf::coordinator
