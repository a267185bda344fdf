// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FileDigests: SHA-256 of files. A file that several frames share is hashed once.
#pragma once

#include <sys/stat.h>

#include <map>
#include <string>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/content/blob_digest.h"

namespace sheaf::cli {

// Thread safety: the member Of may be called concurrently.
class FileDigests {
 public:
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

  Mutex mutex_;
  std::map<Key, BlobDigest> digests_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::cli
