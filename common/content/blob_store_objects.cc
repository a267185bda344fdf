// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of BlobStore that keeps blobs in an ObjectStore, too (docs/adr/0083). An index of the
// objects is in memory, so that a blob that is missing costs no request.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <unordered_set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/file.h"
#include "common/base/log.h"
#include "common/base/status.h"
#include "common/base/write_all.h"
#include "common/content/blob_store.h"
#include "common/content/file_descriptor.h"

namespace sheaf {
namespace {

// The part of an object that is in memory at a time.
constexpr uint64_t kPieceBytes = uint64_t{16} << 20;
// How often an object is fetched whose bytes came with another digest.
constexpr int kFetchesMax = 3;

std::string ObjectKeyOf(const BlobDigest& digest) {
  return absl::StrCat(digest.sha256_hex.substr(0, 2), "/", digest.sha256_hex);
}

// Gives the pieces of an object, in order, to `take`. Errors: also those of take.
absl::Status ForEachPiece(ObjectStore* objects, const BlobDigest& digest,
                          const std::function<absl::Status(const std::string&)>& take) {
  for (uint64_t offset = 0; offset < digest.size_bytes;) {
    const absl::StatusOr<std::string> piece = objects->GetRange(
        ObjectKeyOf(digest), offset, std::min(kPieceBytes, digest.size_bytes - offset));
    if (!piece.ok()) return piece.status();
    if (piece->empty()) return absl::OkStatus();  // Too short; the digest tells.
    if (absl::Status taken = take(*piece); !taken.ok()) return taken;
    offset += piece->size();
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status BlobStore::ListObjects() {
  if (objects_ == nullptr) return absl::OkStatus();
  return objects_->List("", [this](const StoredObject& object) {
    const BlobDigest digest{object.key.substr(object.key.find('/') + 1), object.size_bytes};
    if (!CheckDigest(digest).ok() || object.key != ObjectKeyOf(digest)) return;
    const MutexLock lock(&known_mutex_);
    known_[digest.sha256_hex] = {object.size_bytes, object.written};
  });
}

bool BlobStore::HasObject(const BlobDigest& digest) const {
  if (objects_ == nullptr) return false;
  const MutexLock lock(&known_mutex_);
  const auto known = known_.find(digest.sha256_hex);
  return known != known_.end() && known->second.size_bytes == digest.size_bytes;
}

absl::Status BlobStore::MakeVisible(const BlobDigest& digest,
                                    const std::string& partial_path) const {
  const std::string path = FinalPath(digest);
  absl::Status made = MakeDirectories(path.substr(0, path.rfind('/')));
  if (!made.ok()) return made;
  const MutexLock lock(ObjectLockOf(digest));
  if (objects_ != nullptr && !HasObject(digest)) {
    if (absl::Status put = objects_->PutFile(ObjectKeyOf(digest), partial_path); !put.ok()) {
      // To clients other codes say that they did something wrong.
      return absl::IsResourceExhausted(put) ? put
                                            : absl::UnavailableError(std::string(put.message()));
    }
    const MutexLock known_lock(&known_mutex_);
    known_[digest.sha256_hex] = {digest.size_bytes, absl::Now()};
  }
  if (std::rename(partial_path.c_str(), path.c_str()) == 0) return absl::OkStatus();
  return StatusFromErrno(errno, absl::StrCat("renaming ", partial_path, " to ", path));
}

absl::Status BlobStore::FetchTo(const BlobDigest& digest, const std::string& path) const {
  const FileDescriptor file(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  if (!file.ok()) return StatusFromErrno(errno, absl::StrCat("creating ", path));
  Sha256 hash;
  absl::Status status = ForEachPiece(objects_, digest, [&](const std::string& piece) {
    hash.Update(piece);
    return WriteAll(file.get(), piece, path);
  });
  if (!status.ok()) return status;
  if (hash.FinishHex() != digest.sha256_hex) {
    return absl::DataLossError(absl::StrCat("blob ", digest.sha256_hex, ": its object in ",
                                            objects_->Name(), " has other bytes"));
  }
  ::fchmod(file.get(), 0400);
  if (::fsync(file.get()) == 0) return absl::OkStatus();
  return StatusFromErrno(errno, absl::StrCat("fsync of ", path));
}

absl::Status BlobStore::Restore(const BlobDigest& digest) const {
  const std::string path = FinalPath(digest);
  const std::string fetched = absl::StrCat(directory_, "/partial/", digest.sha256_hex, ".fetched");
  absl::Status status = MakeDirectories(path.substr(0, path.rfind('/')));
  if (!status.ok()) return status;
  for (int fetch = 0; fetch < kFetchesMax; ++fetch) {
    status = FetchTo(digest, fetched);
    if (!absl::IsDataLoss(status)) break;
  }
  if (status.ok() && std::rename(fetched.c_str(), path.c_str()) != 0) {
    status = StatusFromErrno(errno, absl::StrCat("renaming ", fetched, " to ", path));
  }
  if (!status.ok()) {
    ::unlink(fetched.c_str());
    const bool is_gone = absl::IsDataLoss(status) || absl::IsNotFound(status);
    if (is_gone) {
      LogError(absl::StrCat(status.message(), "; the next client that submits it sends it again"));
      const MutexLock lock(&known_mutex_);
      known_.erase(digest.sha256_hex);
    }
    return is_gone ? status : absl::UnavailableError(std::string(status.message()));
  }
  LogInfo(absl::StrCat("blob ", digest.sha256_hex, " is fetched from ", objects_->Name()));
  if (const std::optional<FileState> state = StateOfFile(path)) {
    verified_.Remember(digest.sha256_hex, *state);
  }
  return absl::OkStatus();
}

absl::StatusOr<std::string> BlobStore::DigestOfObject(const BlobDigest& digest) const {
  Sha256 hash;
  absl::Status read = ForEachPiece(objects_, digest, [&hash](const std::string& piece) {
    hash.Update(piece);
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  return hash.FinishHex();
}

absl::StatusOr<bool> BlobStore::RepairObject(const BlobDigest& digest) const {
  if (objects_ == nullptr) return false;
  for (int fetch = 0; fetch < kFetchesMax; ++fetch) {
    const absl::StatusOr<std::string> hex = DigestOfObject(digest);
    if (absl::IsNotFound(hex.status())) break;
    if (!hex.ok()) return hex.status();
    if (*hex == digest.sha256_hex) return false;
  }
  const MutexLock lock(ObjectLockOf(digest));
  const std::string path = FinalPath(digest);
  if (!StateOfFile(path)) return false;  // Removed meanwhile.
  if (absl::Status put = objects_->PutFile(ObjectKeyOf(digest), path); !put.ok()) return put;
  const MutexLock known_lock(&known_mutex_);
  known_[digest.sha256_hex] = {digest.size_bytes, absl::Now()};
  return true;
}

void BlobStore::AddObjects(std::vector<StoredBlob>* blobs) const {
  if (objects_ == nullptr) return;
  std::unordered_set<std::string> present;
  for (const StoredBlob& blob : *blobs) present.insert(blob.digest.sha256_hex);
  const absl::Time now = absl::Now();
  const MutexLock lock(&known_mutex_);
  for (const auto& [hex, object] : known_) {
    if (present.contains(hex)) continue;
    const absl::Duration age = std::max(absl::ZeroDuration(), now - object.written);
    blobs->push_back({{hex, object.size_bytes}, absl::ToChronoNanoseconds(age)});
  }
}

bool BlobStore::RemoveObject(const BlobDigest& digest) const {
  if (objects_ == nullptr) return false;
  const MutexLock lock(ObjectLockOf(digest));
  // Another caller may have brought it again.
  if (StateOfFile(FinalPath(digest))) return false;
  {
    const MutexLock known_lock(&known_mutex_);
    if (!known_.contains(digest.sha256_hex)) return false;
  }
  const absl::Status removed = objects_->Remove(ObjectKeyOf(digest));
  if (!removed.ok()) {
    LogWarning(absl::StrCat("removing a file of scenes: ", removed.message()));
    return false;
  }
  const MutexLock known_lock(&known_mutex_);
  return known_.erase(digest.sha256_hex) > 0;
}

}  // namespace sheaf
