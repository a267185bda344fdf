// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/blob_batch.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string>
#include <unordered_map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "common/base/status.h"
#include "common/base/write_all.h"
#include "common/content/file_descriptor.h"

namespace sheaf {
namespace {

// Files that are open and locked together.
constexpr size_t kWrittenTogetherMax = 512;

using BytesByDigest = std::unordered_map<std::string, std::string_view>;

// Where the bytes of each blob are. Errors: those of PutSmallBlobs.
absl::StatusOr<BytesByDigest> SplitBytes(const std::vector<BlobDigest>& digests,
                                         std::string_view bytes) {
  BytesByDigest by_digest;
  for (const BlobDigest& digest : digests) {
    if (absl::Status status = CheckDigest(digest); !status.ok()) return status;
    if (digest.size_bytes > kSmallBlobBytesMax || digest.size_bytes > bytes.size()) {
      return absl::InvalidArgumentError(absl::StrCat(
          "blob ", digest.sha256_hex, ": ", digest.size_bytes,
          " bytes are more than were sent, or than the ", kSmallBlobBytesMax, " of a small blob"));
    }
    const std::string_view own = bytes.substr(0, digest.size_bytes);
    if (const std::string actual = Sha256Hex(own); actual != digest.sha256_hex) {
      return absl::InvalidArgumentError(
          absl::StrCat("blob ", digest.sha256_hex, ": the bytes received have SHA-256 ", actual,
                       "; the file changed or was damaged in transit"));
    }
    by_digest[digest.sha256_hex] = own;
    bytes.remove_prefix(digest.size_bytes);
  }
  if (bytes.empty()) return by_digest;
  return absl::InvalidArgumentError(
      absl::StrCat(bytes.size(), " bytes more were sent than the blobs have"));
}

// Writes a blob's partial file and keeps it locked, as a BlobWriter does. Invalid: another writer
// brings the blob.
absl::StatusOr<FileDescriptor> WritePartial(const std::string& path, std::string_view bytes) {
  FileDescriptor file(::open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  if (!file.ok()) return StatusFromErrno(errno, absl::StrCat("opening ", path));
  if (::flock(file.get(), LOCK_EX | LOCK_NB) != 0) return FileDescriptor();
  struct stat opened {
  }, named{};
  if (::fstat(file.get(), &opened) != 0 || ::stat(path.c_str(), &named) != 0 ||
      opened.st_ino != named.st_ino) {
    return FileDescriptor();  // Another writer has completed it since.
  }
  if (::ftruncate(file.get(), 0) != 0) {
    return StatusFromErrno(errno, absl::StrCat("truncating ", path));
  }
  if (absl::Status status = WriteAll(file.get(), bytes, path); !status.ok()) {
    ::unlink(path.c_str());
    return status;
  }
  ::fchmod(file.get(), 0400);
  return file;
}

// Makes everything durable that was written to the store's file system.
absl::Status SyncAll(const std::string& directory) {
  const FileDescriptor opened(::open(directory.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (opened.ok() && ::syncfs(opened.get()) == 0) return absl::OkStatus();
  return StatusFromErrno(errno, absl::StrCat("syncfs of ", directory));
}

// Writes blobs that are missing, with one wait for their bytes and one for their names.
absl::Status WriteTogether(const BlobStore& store, const std::vector<BlobDigest>& blobs,
                           const BytesByDigest& bytes) {
  std::vector<std::pair<const BlobDigest*, FileDescriptor>> written;
  for (const BlobDigest& blob : blobs) {
    absl::StatusOr<FileDescriptor> file =
        WritePartial(store.PartialPath(blob), bytes.at(blob.sha256_hex));
    if (!file.ok()) {
      for (const auto& [done, open] : written) ::unlink(store.PartialPath(*done).c_str());
      return file.status();
    }
    if (file->ok()) written.emplace_back(&blob, *std::move(file));
  }
  if (absl::Status status = SyncAll(store.directory()); !status.ok()) return status;
  for (const auto& [blob, file] : written) {
    const absl::Status visible = store.MakeVisible(*blob, store.PartialPath(*blob));
    if (!visible.ok()) return visible;
  }
  return SyncAll(store.directory());
}

}  // namespace

absl::Status PutSmallBlobs(const BlobStore& store, const std::vector<BlobDigest>& digests,
                           std::string_view bytes) {
  const absl::StatusOr<BytesByDigest> by_digest = SplitBytes(digests, bytes);
  if (!by_digest.ok()) return by_digest.status();
  absl::StatusOr<std::vector<BlobDigest>> missing = store.FindMissing(digests);
  if (!missing.ok()) return missing.status();
  std::sort(missing->begin(), missing->end(),
            [](const BlobDigest& a, const BlobDigest& b) { return a.sha256_hex < b.sha256_hex; });
  missing->erase(std::unique(missing->begin(), missing->end()), missing->end());
  for (size_t first = 0; first < missing->size(); first += kWrittenTogetherMax) {
    const auto begin = missing->begin() + static_cast<std::ptrdiff_t>(first);
    const auto count = std::min(kWrittenTogetherMax, missing->size() - first);
    const absl::Status status =
        WriteTogether(store, {begin, begin + static_cast<std::ptrdiff_t>(count)}, *by_digest);
    if (!status.ok()) return status;
  }
  // Each is compared with its name as it is on disk; those that another writer was bringing may
  // not be there yet.
  for (const BlobDigest& blob : *missing) {
    if (store.PathOf(blob).ok()) continue;
    const absl::Status status = store.Put(by_digest->at(blob.sha256_hex)).status();
    if (!status.ok()) return status;
  }
  return store.FindMissing(*missing).status();  // They now count as asked for.
}

}  // namespace sheaf
