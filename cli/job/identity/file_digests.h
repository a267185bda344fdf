// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FileDigests: SHA-256 of files. A file that several frames share is hashed once, and one that has
// not changed since an earlier command not at all (digest_memory.h).
#pragma once

#include <sys/stat.h>

#include <map>
#include <string>

#include "absl/status/statusor.h"
#include "cli/job/identity/digest_memory.h"
#include "common/base/mutex.h"
#include "common/content/blob_digest.h"

namespace sheaf::cli {

// Thread safety: the member Of may be called concurrently.
class FileDigests {
 public:
  // memory must outlive the object; null: nothing is remembered.
  explicit FileDigests(DigestMemory* memory = nullptr) : memory_(memory) {}

  // Errors: those of opening and reading; kFailedPrecondition if the file changes meanwhile.
  absl::StatusOr<BlobDigest> Of(const std::string& path);

 private:
  // Identifies one state of a file.
  struct Key {
    std::string path;
    off_t size_bytes = 0;
    timespec changed{};
    bool operator<(const Key& other) const;
  };
  static absl::StatusOr<Key> KeyOf(const std::string& path);

  DigestMemory* const memory_;
  Mutex mutex_;
  std::map<Key, BlobDigest> digests_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::cli
