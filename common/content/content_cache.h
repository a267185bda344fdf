// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ContentCache: a disk cache of blobs with a size limit, shared by all workers of a machine.
//
//     DIR/lock                  held (flock) while leases, room and eviction are decided
//     DIR/blobs/                a BlobStore
//     DIR/used/HEX              its modification time is when the blob was last used
//     DIR/leases/ID.lock        held (flock) by the process that uses the files of DIR/leases/ID
//     DIR/leases/ID/K/N-NAME    symbolic links to blobs in use, with the extension of the scene's
//     name DIR/leases/ID/K/reserved  its length is the number of bytes still to be downloaded
//
// A lock ends with its process, so the next process that needs room finds and frees the leases of a
// killed worker. A complete blob's file is never changed here, not even its times: any change means
// that the file has been altered.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/content/blob_store.h"
#include "common/content/file_descriptor.h"
#include "common/content/file_state.h"
#include "common/content/manifest.h"

namespace sheaf {

struct ContentCacheLimits {
  uint64_t bytes_max = uint64_t{20} << 30;  // For all blobs, including those in progress.
  // Free bytes that stay on the file system for others, at most 1 / kCacheFreeFractionMax of it.
  uint64_t free_bytes_min = uint64_t{64} << 20;
  // A store whose blobs are used where they lie instead of being fetched, and which outlives the
  // cache; or null.
  const BlobStore* lender = nullptr;
};
inline constexpr uint64_t kCacheFreeFractionMax = 20;

// The files of one scene on this machine; none of them is removed while the lease exists.
class ContentLease {
 public:
  ~ContentLease();
  ContentLease(ContentLease&& other) noexcept;
  ContentLease& operator=(ContentLease&&) = delete;
  // Maps a name in the manifest to a local path that ends with the name's extension.
  const std::map<std::string, std::string>& local_paths() const { return local_paths_; }

 private:
  friend class ContentCache;
  // A blob as it was when it was pinned.
  struct Pinned {
    std::string name;  // Name of one of its files.
    BlobDigest digest;
    FileState state;
    const BlobStore* store = nullptr;  // The store that holds it.
  };
  class Folder;
  ContentLease(std::string directory, std::shared_ptr<Folder> folder)
      : directory_(std::move(directory)), folder_(std::move(folder)) {}
  std::string directory_;           // Empty after a move.
  std::shared_ptr<Folder> folder_;  // Locked while its cache or one of its leases exists.
  std::map<std::string, std::string> local_paths_;
  std::vector<Pinned> pinned_;
};

// Thread safety: all members may be called concurrently, also by several processes.
class ContentCache {
 public:
  // Downloads the bytes of a blob from an offset on and passes them to append, chunk by chunk.
  using Append = std::function<absl::Status(std::string_view bytes)>;
  using Fetch = std::function<absl::Status(const BlobDigest& digest, uint64_t offset_bytes,
                                           const Append& append)>;

  // Creates the directory if it is missing and frees the leases of killed processes.
  static absl::StatusOr<std::unique_ptr<ContentCache>> Open(const std::string& directory,
                                                            ContentCacheLimits limits);

  // Makes all files present and pins them. One process downloads a blob while others wait for it.
  // Errors: kResourceExhausted, with a CacheShortage (the files are larger than the limit or than
  // what the file system has left, or all room is in use);
  // kCancelled (stop was requested); kDataLoss (the downloaded bytes do not match the digest);
  // those of fetch.
  absl::StatusOr<ContentLease> Acquire(const std::vector<ManifestFile>& files, const Fetch& fetch,
                                       std::stop_token stop);

  // Whether the files of a lease are unchanged since it was acquired. Cheap if they are.
  // Errors: kDataLoss, naming a file: data read from it since cannot be trusted, and all files must
  // be acquired again.
  absl::Status CheckUnchanged(const ContentLease& lease) const;

  const BlobStore& blobs() const { return *blobs_; }

 private:
  // Maps a digest to the indices of the files that have it.
  using FilesByDigest = std::map<std::string, std::vector<size_t>>;
  ContentCache(std::string directory, ContentCacheLimits limits, std::unique_ptr<BlobStore> blobs)
      : directory_(std::move(directory)), limits_(std::move(limits)), blobs_(std::move(blobs)) {}
  absl::StatusOr<FileDescriptor> LockCache() const;
  absl::StatusOr<ContentLease> MakeLease();
  // All require LockCache.
  absl::Status MakeLeaseFolder();
  void FreeDeadLeases() const;
  // For the missing ones of the scene's bytes.
  absl::Status MakeRoom(uint64_t missing_bytes, uint64_t scene_bytes) const;
  // The free bytes of the file system beyond its minimum.
  uint64_t FreeBytes() const;
  // Where the blob lies; null where it has to be fetched.
  const BlobStore* StoreOf(const BlobDigest& digest) const;
  // Links one blob into the lease under the names of its files. Errors: kNotFound.
  absl::Status Link(const std::vector<ManifestFile>& files, const std::vector<size_t>& indices,
                    ContentLease* lease);
  // Makes a lease on the blobs that are present, and room for the missing ones.
  absl::StatusOr<ContentLease> PinPresent(const std::vector<ManifestFile>& files,
                                          const FilesByDigest& by_digest, uint64_t scene_bytes,
                                          std::vector<std::string>* missing);
  absl::StatusOr<ContentLease> AcquireAll(const std::vector<ManifestFile>& files,
                                          const FilesByDigest& by_digest, uint64_t scene_bytes,
                                          const Fetch& fetch, const std::stop_token& stop);
  absl::Status DownloadMissing(const std::vector<ManifestFile>& files,
                               const FilesByDigest& by_digest,
                               const std::vector<std::string>& missing, const Fetch& fetch,
                               std::stop_token stop, ContentLease* lease);
  absl::Status Download(const BlobDigest& digest, const Fetch& fetch, std::stop_token stop);

  const std::string directory_;
  const ContentCacheLimits limits_;
  const std::unique_ptr<BlobStore> blobs_;
  std::shared_ptr<ContentLease::Folder> lease_folder_;
  Mutex mutex_;
  uint64_t lease_count_ ABSL_GUARDED_BY(mutex_) = 0;
};

}  // namespace sheaf
