// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CallTimer: measures each gRPC call, from the moment that its handler may begin to the sending of
// its status. It does not see calls that CallGate refuses.
#pragma once

#include <grpcpp/server_builder.h>

#include "coordinator/service/view/call_times.h"

namespace sheaf::coordinator {

// Records calls of all services of the server under names such as "WorkerService/Synchronize" with
// codes such as "NOT_FOUND"; streams with their whole duration. Adds the version of the protocol to
// answers (protocol_calls.h). times must outlive the server.
void TimeCalls(CallTimes* times, grpc::ServerBuilder* builder);

}  // namespace sheaf::coordinator
