// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ChunkIndex: finds chunks in the blobs of a store. Blobs are stored whole; beside them lie their
// lists, from which the index is rebuilt:
//
//     STORE/chunks/HEX      the list of the blob HEX (EncodeChunkList)
//
// A blob without a list, as stores of before have them, is cut when its list is asked for.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/content/blob_store.h"
#include "common/content/chunk_list.h"

namespace sheaf {

// Chunks that can be found, about 1 TiB of blobs; those beyond are transferred again.
inline constexpr size_t kIndexedChunksMax = size_t{1} << 20;

// Thread safety: all members may be called concurrently.
class ChunkIndex {
 public:
  // store must outlive the index. The lists are read at the first use.
  explicit ChunkIndex(const BlobStore* store) : store_(*store) {}

  // Keeps the list of a blob that is stored. Requires: each chunk was verified as it was written.
  // Errors: those of files.
  absl::Status Add(const ChunkList& list);
  // The list of a stored blob. Errors: those of BlobStore::PathOf and of files.
  absl::StatusOr<ChunkList> ListOf(const BlobDigest& blob);
  // Whether a stored blob has the chunk; the blob then counts as asked for (kAskedKept).
  bool Has(const BlobDigest& chunk);
  // The verified bytes of a chunk. Errors: kNotFound: no blob has it any longer, or only with other
  // bytes.
  absl::StatusOr<std::string> Read(const BlobDigest& chunk);

 private:
  struct Place {
    size_t blob = 0;  // Index in blobs_.
    uint64_t offset_bytes = 0;
  };
  std::string PathOf(const BlobDigest& blob) const;
  void LoadOnce() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Index(const ChunkList& list) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Where the chunk is, in a blob that is there.
  absl::StatusOr<std::pair<BlobDigest, uint64_t>> Find(const BlobDigest& chunk);

  const BlobStore& store_;
  Mutex mutex_;
  bool loaded_ ABSL_GUARDED_BY(mutex_) = false;
  std::vector<BlobDigest> blobs_ ABSL_GUARDED_BY(mutex_);
  std::unordered_map<std::string, Place> places_ ABSL_GUARDED_BY(mutex_);  // By the chunk's digest.
};

}  // namespace sheaf
