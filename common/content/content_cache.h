// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ContentCache: a disk cache of blobs with a limit, shared by all workers of a machine.
//
//     DIR/lock                  taken (flock) while leases, room and eviction are decided
//     DIR/blobs/                a BlobStore
//     DIR/used/HEX              its time says when the blob was used last
//     DIR/leases/ID.lock        held (flock) by the process that uses the files of DIR/leases/ID
//     DIR/leases/ID/K/N-NAME    symbolic links to blobs in use, named to end like the scene's own
//     DIR/leases/ID/K/reserved  its length says how many bytes are still to be downloaded
//
// A lock dies with its process, so what a killed worker held is found and freed by the next one
// that needs room. Nothing here changes a blob's file once it is complete, not even its times:
// whatever does has altered it.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <stop_token>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/content/blob_store.h"
#include "common/content/file_descriptor.h"
#include "common/content/file_state.h"
#include "common/content/manifest.h"

namespace sheaf {

struct ContentCacheLimits {
  uint64_t bytes_max = uint64_t{20} << 30;  // Of all blobs, those under way included.
};

// The files of one scene on this machine; none of them vanishes while the lease lives.
class ContentLease {
 public:
  ~ContentLease();
  ContentLease(ContentLease&& other) noexcept;
  ContentLease& operator=(ContentLease&&) = delete;
  // Name in the manifest to a local path that ends with the name's extension.
  const std::map<std::string, std::string>& local_paths() const { return local_paths_; }

 private:
  friend class ContentCache;
  // A blob as it was when it was pinned.
  struct Pinned {
    std::string name;  // Of one of its files.
    BlobDigest digest;
    FileState state;
  };
  class Folder;
  ContentLease(std::string directory, std::shared_ptr<Folder> folder)
      : directory_(std::move(directory)), folder_(std::move(folder)) {}
  std::string directory_;           // Empty after a move.
  std::shared_ptr<Folder> folder_;  // Locked while its cache or one of its leases lives.
  std::map<std::string, std::string> local_paths_;
  std::vector<Pinned> pinned_;
};

// Thread safety: all members may be called concurrently, also by several processes.
class ContentCache {
 public:
  // Takes the bytes of a blob from an offset on and gives them to append, run by run.
  using Append = std::function<absl::Status(std::string_view bytes)>;
  using Fetch = std::function<absl::Status(const BlobDigest& digest, uint64_t offset_bytes,
                                           const Append& append)>;

  // Makes the directory where it is missing and frees what killed processes left.
  static absl::StatusOr<std::unique_ptr<ContentCache>> Open(const std::string& directory,
                                                            ContentCacheLimits limits);

  // Makes all files present and pins them. One process downloads a blob while others wait for it.
  // Errors: kResourceExhausted (the files are larger than the limit, or all the room is in use);
  // kCancelled (stop was requested); kDataLoss (the bytes fetched are not the blob); those of
  // fetch.
  absl::StatusOr<ContentLease> Acquire(const std::vector<ManifestFile>& files, const Fetch& fetch,
                                       std::stop_token stop);

  // Whether the files of a lease are what they were when it was acquired. Cheap while they are.
  // Errors: kDataLoss, naming a file: what was read of it since is not to be trusted, and all of
  // them must be acquired anew.
  absl::Status CheckUnchanged(const ContentLease& lease) const;

  const BlobStore& blobs() const { return *blobs_; }

 private:
  // Digest to the indices of the files that have it.
  using FilesByDigest = std::map<std::string, std::vector<size_t>>;
  ContentCache(std::string directory, ContentCacheLimits limits, std::unique_ptr<BlobStore> blobs)
      : directory_(std::move(directory)), limits_(limits), blobs_(std::move(blobs)) {}
  absl::StatusOr<FileDescriptor> LockCache() const;
  absl::StatusOr<ContentLease> MakeLease();
  // All require LockCache.
  absl::Status MakeLeaseFolder();
  void FreeDeadLeases() const;
  absl::Status MakeRoom(uint64_t size_bytes) const;
  // Links one blob into the lease under the names of its files. Errors: kNotFound.
  absl::Status Link(const std::vector<ManifestFile>& files, const std::vector<size_t>& indices,
                    ContentLease* lease);
  // Makes a lease on the blobs that are here, and room for those that are missing.
  absl::StatusOr<ContentLease> PinPresent(const std::vector<ManifestFile>& files,
                                          const FilesByDigest& by_digest,
                                          std::vector<std::string>* missing);
  absl::Status DownloadMissing(const std::vector<ManifestFile>& files,
                               const FilesByDigest& by_digest,
                               const std::vector<std::string>& missing, const Fetch& fetch,
                               std::stop_token stop, ContentLease* lease);
  absl::Status Download(const BlobDigest& digest, const Fetch& fetch, std::stop_token stop);

  const std::string directory_;
  const ContentCacheLimits limits_;
  const std::unique_ptr<BlobStore> blobs_;
  std::shared_ptr<ContentLease::Folder> lease_folder_;
  std::mutex mutex_;
  uint64_t lease_count_ = 0;  // Guarded by mutex_.
};

}  // namespace sheaf
