// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/upload_use.h"

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "coordinator/service/grpc/caller.h"

namespace sheaf::coordinator {

absl::Status BeginUpload(const grpc::ServerContext& context, AccessControl* access,
                         const char* operation, uint64_t size_bytes) {
  const absl::StatusOr<IdentityId> id = ParseIdentity(CallerIdentity(context));
  if (access == nullptr || !id.ok()) return absl::OkStatus();
  const absl::Time now = absl::Now();
  absl::Status allowed = access->use().BeginUpload(*id, size_bytes, now);
  if (!allowed.ok()) {
    access->NoteRefused(absl::StrCat(FormatIdentity(*id), " at ", context.peer()), operation,
                        allowed, now);
  }
  return allowed;
}

void ReturnUpload(const grpc::ServerContext& context, AccessControl* access,
                  uint64_t missing_bytes) {
  const absl::StatusOr<IdentityId> id = ParseIdentity(CallerIdentity(context));
  if (access != nullptr && id.ok()) access->use().ReturnUpload(*id, missing_bytes);
}

}  // namespace sheaf::coordinator
