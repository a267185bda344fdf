// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of DiskKeeper that computes users' stored bytes. A file of a scene counts for a user if
// no other user's jobs need it; a file that no job needs counts for the user who uploaded it since
// the coordinator started.
#include <map>
#include <set>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"
#include "coordinator/service/farm/upkeep/disk_keeper.h"

namespace sheaf::coordinator {

void DiskKeeper::NoteUpload(const std::string& owner, const BlobDigest& blob, uint64_t bytes) {
  const MutexLock lock(&uploads_mutex_);
  if (uploaders_.size() >= kUploadersRememberedMax) uploaders_.clear();
  uploaders_[blob.sha256_hex] = owner;
  uploaded_since_[owner] += bytes;
}

absl::StatusOr<std::map<std::string, OwnerBytes>> DiskKeeper::BytesByOwner() {
  const MutexLock lock(&mutex_);
  if (SteadyTime::Now() >= next_owner_bytes_) {
    std::map<std::string, std::string> uploaders;
    {
      const MutexLock taking(&uploads_mutex_);
      uploaders = uploaders_;
      uploaded_since_.clear();  // The files are listed below.
    }
    absl::StatusOr<std::map<std::string, OwnerBytes>> listed = ListBytesByOwner(uploaders);
    if (!listed.ok()) return listed.status();
    owner_bytes_ = *std::move(listed);
    next_owner_bytes_ = SteadyTime::Now() + kOwnerBytesInterval;
  }
  std::map<std::string, OwnerBytes> owners = owner_bytes_;
  const MutexLock adding(&uploads_mutex_);
  for (const auto& [owner, bytes] : uploaded_since_) owners[owner].content_bytes += bytes;
  return owners;
}

absl::StatusOr<std::map<std::string, OwnerBytes>> DiskKeeper::ListBytesByOwner(
    const std::map<std::string, std::string>& uploaders) {
  std::map<std::string, OwnerBytes> owners;
  const std::map<uint64_t, JobUse> jobs = ListJobs();
  const absl::StatusOr<std::map<uint64_t, uint64_t>> parts = store_.PartsBytesByJob();
  if (!parts.ok()) return parts.status();
  const std::map<uint64_t, uint64_t> previews = previews_.BytesByJob();
  const auto bytes_of = [](const std::map<uint64_t, uint64_t>& bytes, uint64_t id) {
    const auto found = bytes.find(id);
    return found == bytes.end() ? 0 : found->second;
  };
  std::map<std::string, std::set<std::string>> users;  // By blob that a job names.
  for (const auto& [id, job] : jobs) {
    OwnerBytes& owner = owners[job.owner];
    owner.part_bytes += bytes_of(*parts, id);
    owner.preview_bytes += bytes_of(previews, id);
    owner.image_bytes += OutputBytes(id);
    for (const BlobDigest& image : job.images) users[image.sha256_hex].insert(job.owner);
    for (const BlobDigest& scene : job.scenes) {
      users[scene.sha256_hex].insert(job.owner);
      const absl::StatusOr<std::vector<std::string>> files = FilesOf(scene);
      if (!files.ok()) continue;  // Its list of files is lost: they have no owner.
      for (const std::string& hex : *files) users[hex].insert(job.owner);
    }
  }
  for (const StoredBlob& blob : blobs_.List()) {
    const auto named = users.find(blob.digest.sha256_hex);
    const auto uploader = uploaders.find(blob.digest.sha256_hex);
    if (named != users.end()) {
      if (named->second.size() > 1) continue;
      owners[*named->second.begin()].content_bytes += blob.digest.size_bytes;
    } else if (uploader != uploaders.end()) {
      owners[uploader->second].content_bytes += blob.digest.size_bytes;
    }
  }
  return owners;
}

absl::Status DiskKeeper::CheckOwner(const std::string& owner, uint64_t more) {
  if (owner_bytes_max_ == UINT64_MAX) return absl::OkStatus();
  const absl::StatusOr<std::map<std::string, OwnerBytes>> owners = BytesByOwner();
  if (!owners.ok()) return owners.status();
  const auto found = owners->find(owner);
  const OwnerBytes kept = found == owners->end() ? OwnerBytes() : found->second;
  return CheckOwnerBytes(owner, kept, more, owner_bytes_max_);
}

}  // namespace sheaf::coordinator
