// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Counts the bytes that a caller uploads, whichever call brings them, against its limit of a day.
#pragma once

#include <grpcpp/server_context.h>

#include <cstdint>

#include "absl/status/status.h"
#include "coordinator/access/access_control.h"

namespace sheaf::coordinator {

// Counts an upload of so many bytes. access: null without certificates. operation: for the audit
// log. Errors: kResourceExhausted, recorded.
absl::Status BeginUpload(const grpc::ServerContext& context, AccessControl* access,
                         const char* operation, uint64_t size_bytes);
// Takes back what did not come of it.
void ReturnUpload(const grpc::ServerContext& context, AccessControl* access,
                  uint64_t missing_bytes);

}  // namespace sheaf::coordinator
