// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/grpc/upload_use.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/content/shared_upload.h"
#include "coordinator/service/grpc/caller.h"

namespace sheaf::coordinator {
namespace {

absl::Status RequireRoom(const grpc::ServerContext& context, Farm* farm, AccessControl* access,
                         const char* operation, uint64_t size_bytes) {
  absl::Status room = farm->keeper().CheckOwner(OwnerOf(context), size_bytes);
  if (room.ok() || access == nullptr) return room;
  access->use().NoteRefused(IdentityLimit::kStoredBytes);
  access->NoteRefused(absl::StrCat(CallerIdentity(context), " at ", context.peer()), operation,
                      room, absl::Now());
  return room;
}

}  // namespace

absl::StatusOr<UploadClaim> BeginUpload(const grpc::ServerContext& context, Farm* farm,
                                        AccessControl* access, const char* operation,
                                        const std::string& blob, uint64_t size_bytes) {
  absl::StatusOr<UploadClaim> claim = farm->keeper().ClaimUpload(blob, size_bytes);
  if (!claim.ok()) return claim;
  if (absl::Status room = RequireRoom(context, farm, access, operation, size_bytes); !room.ok()) {
    return room;
  }
  const absl::StatusOr<IdentityId> id = ParseIdentity(CallerIdentity(context));
  if (access == nullptr || !id.ok()) return claim;
  const absl::Time now = absl::Now();
  absl::Status allowed = access->use().BeginUpload(*id, size_bytes, now);
  if (!allowed.ok()) {
    access->NoteRefused(absl::StrCat(FormatIdentity(*id), " at ", context.peer()), operation,
                        allowed, now);
    return allowed;
  }
  return claim;
}

absl::Status OfSharedUpload(absl::Status status) {
  return absl::IsUnavailable(status) ? SharedUploadError() : std::move(status);
}

void ReturnUpload(const grpc::ServerContext& context, AccessControl* access,
                  uint64_t missing_bytes) {
  const absl::StatusOr<IdentityId> id = ParseIdentity(CallerIdentity(context));
  if (access != nullptr && id.ok()) access->use().ReturnUpload(*id, missing_bytes);
}

void NoteUpload(const grpc::ServerContext& context, Farm* farm, const BlobDigest& blob,
                uint64_t bytes) {
  farm->NoteUpload(OwnerOf(context), blob, bytes);
  farm->content().NoteReceived(bytes);
}

}  // namespace sheaf::coordinator
