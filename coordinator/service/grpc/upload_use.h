// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Counts the bytes that a caller uploads, whichever call brings them, against its limits of a day
// and of what it may keep.
#pragma once

#include <grpcpp/server_context.h>

#include <cstdint>

#include "absl/status/status.h"
#include "common/content/blob_digest.h"
#include "coordinator/access/access_control.h"
#include "coordinator/service/farm/farm.h"

namespace sheaf::coordinator {

// Whether the caller may keep so many more bytes, and upload them today; counts them. access: null
// without certificates. operation: for the audit log. Errors: kResourceExhausted, recorded.
absl::Status BeginUpload(const grpc::ServerContext& context, Farm* farm, AccessControl* access,
                         const char* operation, uint64_t size_bytes);
// Takes back what did not come of it.
void ReturnUpload(const grpc::ServerContext& context, AccessControl* access,
                  uint64_t missing_bytes);
// So many bytes of the blob have come from the caller: for accounts and metrics.
void NoteUpload(const grpc::ServerContext& context, Farm* farm, const BlobDigest& blob,
                uint64_t bytes);

}  // namespace sheaf::coordinator
