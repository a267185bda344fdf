// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/verified_files.h"

#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <system_error>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "common/base/log.h"

namespace sheaf {
namespace {

constexpr size_t kVerifiedFilesMax = 1 << 20;

// Removes the oldest files until the rest are within the bounds.
void LimitFolder(const std::string& folder) {
  namespace fs = std::filesystem;
  std::vector<std::tuple<int64_t, uint64_t, std::string>> files;  // Time, size, path.
  uint64_t bytes = 0;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::optional<FileState> state = StateOfFile(it->path().string());
    if (!state) continue;
    files.emplace_back(state->changed_ns, state->size_bytes, it->path().string());
    bytes += state->size_bytes;
  }
  std::sort(files.begin(), files.end());
  size_t count = files.size();
  for (const auto& [time, size_bytes, path] : files) {
    if (count <= kDamagedKeptMax && bytes <= kDamagedBytesMax) return;
    if (::unlink(path.c_str()) != 0) continue;
    --count;
    bytes -= size_bytes;
  }
}

}  // namespace

bool VerifiedFiles::Contains(const std::string& name, const FileState& state) const {
  const MutexLock lock(&mutex_);
  const auto found = files_.find(name);
  return found != files_.end() && found->second.state == state &&
         now_() - found->second.time < kVerifiedAgeMax;
}

void VerifiedFiles::Remember(const std::string& name, const FileState& state) {
  const MutexLock lock(&mutex_);
  if (files_.size() >= kVerifiedFilesMax && !files_.contains(name)) return;
  files_[name] = {state, now_()};
}

void VerifiedFiles::Forget(const std::string& name) {
  const MutexLock lock(&mutex_);
  files_.erase(name);
}

void MoveAside(const std::string& path, const std::string& folder, const std::string& name) {
  MakeDirectories(folder).IgnoreError();
  const std::string aside = absl::StrCat(folder, "/", name);
  if (std::rename(path.c_str(), aside.c_str()) != 0) ::unlink(path.c_str());
  LimitFolder(folder);
  LogWarning(absl::StrCat(path, ": the bytes differ from those stored; moved to ", aside));
}

}  // namespace sheaf
