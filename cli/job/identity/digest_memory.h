// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DigestMemory: the digests of large files from one command to the next, so that a scene that has
// not changed is not read again. A file counts as the same while its state (file_state.h) is. The
// memory is a cache: it may be removed at any time, and a wrong entry is detected when the file is
// uploaded.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "common/base/mutex.h"
#include "common/content/blob_digest.h"
#include "common/content/file_state.h"

namespace sheaf::cli {

// Smaller files are hashed each time.
inline constexpr uint64_t kRememberedBytesMin = uint64_t{64} << 10;
inline constexpr size_t kRememberedFilesMax = 100'000;
// A file that was changed less than this before it was hashed may change again with the same time
// stamp.
inline constexpr int64_t kSettledNanoseconds = 2'000'000'000;

// Thread safety: all members may be called concurrently.
class DigestMemory {
 public:
  // Reads the file at path, if there is one. path may be empty: nothing is remembered.
  explicit DigestMemory(std::string path);

  // "$XDG_CACHE_HOME/sheaf-digests" or "~/.cache/sheaf-digests"; empty without a home.
  static std::string DefaultPath();

  // path: a file's, absolute.
  std::optional<BlobDigest> Find(const std::string& path, const FileState& state) const;
  // now_ns: the time, since the epoch, at which the file began to be hashed.
  void Remember(const std::string& path, const FileState& state, const BlobDigest& digest,
                int64_t now_ns);
  // Writes new entries. Files whose entries cannot be written are hashed again next time.
  void Save() const;

 private:
  struct Entry {
    FileState state;
    std::string sha256_hex;
  };
  const std::string file_;
  mutable Mutex mutex_;
  std::map<std::string, Entry> entries_ ABSL_GUARDED_BY(mutex_);  // At most kRememberedFilesMax.
  bool changed_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace sheaf::cli
