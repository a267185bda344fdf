// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VerifiedFiles: remembers files whose bytes matched a digest, and their states at that time. While
// a file's state does not change, its bytes are trusted for a limited time; damaged files are moved
// aside.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <unordered_map>
#include <utility>

#include "common/base/mutex.h"
#include "common/content/file_state.h"

namespace sheaf {

// How long a file with unchanged state is trusted.
inline constexpr std::chrono::hours kVerifiedAgeMax{1};
// Maximum number of files kept in a folder of damaged files; the latest stay.
inline constexpr size_t kDamagedKeptMax = 16;
inline constexpr uint64_t kDamagedBytesMax = uint64_t{1} << 30;

// Thread safety: all members may be called concurrently.
class VerifiedFiles {
 public:
  using Clock = std::chrono::steady_clock;
  explicit VerifiedFiles(std::function<Clock::time_point()> now = Clock::now)
      : now_(std::move(now)) {}

  // Whether the file's bytes were verified in this state recently enough.
  bool Contains(const std::string& name, const FileState& state) const;
  void Remember(const std::string& name, const FileState& state);
  void Forget(const std::string& name);

 private:
  struct Verified {
    FileState state;
    Clock::time_point time;
  };
  const std::function<Clock::time_point()> now_;
  mutable Mutex mutex_;
  // At most kVerifiedFilesMax.
  std::unordered_map<std::string, Verified> files_ ABSL_GUARDED_BY(mutex_);
};

// Moves a damaged file into the folder, which is created if missing, and keeps the folder within
// its bounds. A file that cannot be moved is removed.
void MoveAside(const std::string& path, const std::string& folder, const std::string& name);

}  // namespace sheaf
