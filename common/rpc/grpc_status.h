// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Converts between absl::Status and grpc::Status. Both use the canonical codes, so nothing is lost
// but gRPC's binary details, which Sheaf does not send.
#pragma once

#include <grpcpp/support/status.h>

#include <string>

#include "absl/status/status.h"

namespace sheaf {

// Returns the same code and message for the wire.
grpc::Status ToGrpcStatus(const absl::Status& status);
// Returns the same code and message; a code that is not canonical becomes kUnknown. gRPC's own
// messages about connections are replaced by plain words: "the connection was refused". A call
// whose message could not be read names the field that is not UTF-8.
absl::Status FromGrpcStatus(const grpc::Status& status);

// Rewords the error of a call to the coordinator that ended with kUnavailable or kDeadlineExceeded:
// the address, the cause, and what to do, under the same code. Other errors are returned unchanged.
absl::Status NoCoordinatorAnswers(const std::string& address, const absl::Status& status);

}  // namespace sheaf
