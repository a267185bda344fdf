// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VerifiedFiles: files whose bytes were compared with a digest, and the states they were in then. A
// file whose state does not change keeps its bytes, for a time; and what turns out to be damaged is
// moved aside.
#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <unordered_map>
#include <utility>

#include "common/content/file_state.h"

namespace sheaf {

// For how long a file whose state does not change is taken to have the bytes it had.
inline constexpr std::chrono::hours kVerifiedAgeMax{1};
// A folder of damaged files keeps the last ones.
inline constexpr size_t kDamagedKeptMax = 16;
inline constexpr uint64_t kDamagedBytesMax = uint64_t{1} << 30;

// Thread safety: all members may be called concurrently.
class VerifiedFiles {
 public:
  using Clock = std::chrono::steady_clock;
  explicit VerifiedFiles(std::function<Clock::time_point()> now = Clock::now)
      : now_(std::move(now)) {}

  // Whether the file is in a state in which its bytes were verified, not too long ago.
  bool Contains(const std::string& name, const FileState& state) const;
  void Remember(const std::string& name, const FileState& state);
  void Forget(const std::string& name);

 private:
  struct Verified {
    FileState state;
    Clock::time_point time;
  };
  const std::function<Clock::time_point()> now_;
  mutable std::mutex mutex_;
  std::unordered_map<std::string, Verified> files_;  // At most kVerifiedFilesMax.
};

// Moves a damaged file into the folder, which is made where it is missing, and keeps the folder
// within its bounds. What cannot be moved is removed.
void MoveAside(const std::string& path, const std::string& folder, const std::string& name);

}  // namespace sheaf
