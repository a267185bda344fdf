// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/server/dropped_jobs.h"

#include <unistd.h>

#include <cerrno>
#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/status.h"
#include "common/content/blob_store.h"
#include "coordinator/service/dropped/dropped_files.h"
#include "coordinator/service/grpc/wire.h"

namespace sheaf::coordinator {
namespace {

constexpr char kCreateJob[] = "/sheaf.v1.JobService/CreateJob";

// Checks that the user, who was admitted before the scene was read, may still submit.
absl::Status CheckStillAllowed(AccessControl* access, const std::string& owner) {
  if (access == nullptr) return absl::OkStatus();
  const IdentityId id{IdentityKind::kUser, owner};
  const absl::StatusOr<std::optional<Identity>> identity = access->identities().Find(id);
  if (!identity.ok()) return identity.status();
  if (!identity->has_value() || (*identity)->revoked()) {
    return absl::PermissionDeniedError(absl::StrCat(FormatIdentity(id), " is revoked"));
  }
  return AccessControl::Authorize(Caller{**identity}, kCreateJob);
}

absl::Status AppendFile(const std::string& folder, const std::string& path, BlobWriter* writer) {
  const absl::StatusOr<FileDescriptor> file = OpenBeneath(folder, path);
  if (!file.ok()) return file.status();
  std::vector<char> piece(kBlobChunkBytesMax);
  while (true) {
    const ssize_t size = ::read(file->get(), piece.data(), piece.size());
    if (size < 0 && errno == EINTR) continue;
    if (size < 0) return StatusFromErrno(errno, absl::StrCat("reading ", path));
    if (size == 0) return absl::OkStatus();
    absl::Status status = writer->Append({piece.data(), static_cast<size_t>(size)});
    if (!status.ok()) return status;
  }
}

// Counts the bytes against the limits of the owner.
absl::Status StoreBlob(const DroppedJobsTo& to, const std::string& owner, const std::string& folder,
                       const BlobDigest& digest, const v1::PreparedBlob& blob) {
  absl::Status room = to.farm->keeper().CheckOwner(owner, digest.size_bytes);
  if (!room.ok() && to.access != nullptr) to.access->use().NoteRefused(IdentityLimit::kStoredBytes);
  if (!room.ok()) return room;
  absl::StatusOr<BlobWriter> writer = to.farm->blobs().BeginWrite(digest, 0);
  if (absl::IsAlreadyExists(writer.status())) return absl::OkStatus();
  if (!writer.ok()) return writer.status();
  const absl::StatusOr<UploadClaim> claim =
      to.farm->keeper().ClaimUpload(digest.sha256_hex, digest.size_bytes);
  if (!claim.ok()) {
    writer->Discard();
    return claim.status();
  }
  const IdentityId id{IdentityKind::kUser, owner};
  if (to.access != nullptr) {
    absl::Status allowed = to.access->use().BeginUpload(id, digest.size_bytes, absl::Now());
    if (!allowed.ok()) return allowed;
  }
  absl::Status status = blob.path().empty() ? writer->Append(blob.content())
                                            : AppendFile(folder, blob.path(), &*writer);
  if (status.ok()) status = writer->Commit();
  if (status.ok()) {
    to.farm->NoteUpload(owner, digest, digest.size_bytes);
    to.farm->content().NoteReceived(digest.size_bytes);
  } else if (to.access != nullptr) {
    to.access->use().ReturnUpload(id, digest.size_bytes);
  }
  return status;
}

absl::Status StoreMissing(const DroppedJobsTo& to, const std::string& owner,
                          const std::string& folder, const v1::PrepareReply& reply) {
  std::vector<BlobDigest> digests;
  std::map<std::string, const v1::PreparedBlob*> by_digest;
  for (const v1::PreparedBlob& blob : reply.blobs()) {
    absl::StatusOr<BlobDigest> digest = FromWire(blob.digest());
    if (!digest.ok()) return digest.status();
    if (by_digest.emplace(digest->sha256_hex, &blob).second) digests.push_back(*std::move(digest));
  }
  const absl::StatusOr<std::vector<BlobDigest>> missing = to.farm->blobs().FindMissing(digests);
  if (!missing.ok()) return missing.status();
  for (const BlobDigest& digest : *missing) {
    absl::Status status = StoreBlob(to, owner, folder, digest, *by_digest.at(digest.sha256_hex));
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> Make(const DroppedJobsTo& to, const std::string& owner,
                                 const std::string& folder, const v1::PrepareReply& reply) {
  if (absl::Status status = CheckStillAllowed(to.access, owner); !status.ok()) return status;
  if (absl::Status status = StoreMissing(to, owner, folder, reply); !status.ok()) return status;
  const absl::StatusOr<JobView> job = to.jobs->CreateFor(owner, reply.job());
  if (!job.ok()) return job.status();
  return job->job_id;
}

}  // namespace

absl::StatusOr<std::string> MakeDroppedJob(const DroppedJobsTo& to, const SubmissionCaller& caller,
                                           const std::string& folder,
                                           const v1::PrepareReply& reply) {
  absl::StatusOr<std::string> job = Make(to, caller.owner, folder, reply);
  if (to.access != nullptr) {
    const std::string target = job.ok() ? absl::StrCat("jobs/", *job) : reply.job().title();
    to.access->audit().Note(caller.who, "CreateJob", target, job.status());
  }
  return job;
}

}  // namespace sheaf::coordinator
