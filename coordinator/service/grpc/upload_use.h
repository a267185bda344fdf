// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Counts the bytes that a caller uploads by any call against its daily limit and its limit of
// stored bytes.
#pragma once

#include <grpcpp/server_context.h>

#include <cstdint>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/content/blob_digest.h"
#include "coordinator/access/access_control.h"
#include "coordinator/service/farm/farm.h"

namespace sheaf::coordinator {

// Checks that the disk has space for the bytes, and that the caller may store them and upload them
// today; counts them. access: null without certificates. operation: for the audit log. blob: its
// SHA-256, or empty for several. Errors: kResourceExhausted, recorded if the caller is to blame.
absl::StatusOr<UploadClaim> BeginUpload(const grpc::ServerContext& context, Farm* farm,
                                        AccessControl* access, const char* operation,
                                        const std::string& blob, uint64_t size_bytes);
// Tells the caller to wait if another client writes the blob. status: of the blob store.
absl::Status OfSharedUpload(absl::Status status);
// Returns the bytes that the upload did not send.
void ReturnUpload(const grpc::ServerContext& context, AccessControl* access,
                  uint64_t missing_bytes);
// Records this many bytes of the blob from the caller, for accounts and metrics.
void NoteUpload(const grpc::ServerContext& context, Farm* farm, const BlobDigest& blob,
                uint64_t bytes);

}  // namespace sheaf::coordinator
