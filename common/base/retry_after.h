// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Refusals that pass by themselves. Others of the same code stay until a user ends a job or frees
// disk space; waiting for them only delays a message that the caller should read. The mark is in
// the message, because gRPC transports nothing else if a call is refused before its handler.
#pragma once

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/time/time.h"

namespace sheaf {

// kResourceExhausted with the message, followed by "; retry after 0.5 s". Requires: a positive,
// finite duration.
absl::Status RetryAfterError(const std::string& message, absl::Duration wait);

// After which time the call may be repeated; none where the status does not say so.
std::optional<absl::Duration> RetryAfterOf(const absl::Status& status);

}  // namespace sheaf
