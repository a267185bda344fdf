// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/identity/digest_memory.h"

#include <algorithm>
#include <cstdlib>
#include <utility>
#include <vector>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "common/base/surroundings/home_directory.h"

namespace sheaf::cli {
namespace {

constexpr char kFirstLine[] = "sheaf digests 1";
constexpr uint64_t kFileBytesMax = uint64_t{64} << 20;

}  // namespace

DigestMemory::DigestMemory(std::string path) : file_(std::move(path)) {
  if (file_.empty()) return;
  const absl::StatusOr<std::string> text = ReadWholeFile(file_, kFileBytesMax);
  if (!text.ok()) return;
  const std::vector<std::string> lines = absl::StrSplit(*text, '\n', absl::SkipEmpty());
  if (lines.empty() || lines.front() != kFirstLine) return;
  for (size_t i = 1; i < lines.size() && entries_.size() < kRememberedFilesMax; ++i) {
    const std::vector<std::string> parts = absl::StrSplit(lines[i], absl::MaxSplits(' ', 6));
    Entry entry;
    FileState& state = entry.state;
    const bool is_whole = parts.size() == 7 && IsSha256Hex(parts[0]) &&
                          absl::SimpleAtoi(parts[1], &state.size_bytes) &&
                          absl::SimpleAtoi(parts[2], &state.device) &&
                          absl::SimpleAtoi(parts[3], &state.inode) &&
                          absl::SimpleAtoi(parts[4], &state.modified_ns) &&
                          absl::SimpleAtoi(parts[5], &state.changed_ns);
    if (!is_whole) continue;
    entry.sha256_hex = parts[0];
    entries_[parts[6]] = std::move(entry);
  }
}

std::string DigestMemory::DefaultPath() {
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache != nullptr && cache[0] == '/') {
    return absl::StrCat(cache, "/sheaf-digests");
  }
  const std::string home = HomeDirectory();
  return home.empty() ? "" : absl::StrCat(home, "/.cache/sheaf-digests");
}

std::optional<BlobDigest> DigestMemory::Find(const std::string& path,
                                             const FileState& state) const {
  const MutexLock lock(&mutex_);
  const auto found = entries_.find(path);
  if (found == entries_.end() || found->second.state != state) return std::nullopt;
  return BlobDigest{found->second.sha256_hex, state.size_bytes};
}

void DigestMemory::Remember(const std::string& path, const FileState& state,
                            const BlobDigest& digest, int64_t now_ns) {
  const bool settled =
      std::max(state.modified_ns, state.changed_ns) <= now_ns - kSettledNanoseconds;
  const bool fits = digest.size_bytes == state.size_bytes &&
                    digest.size_bytes >= kRememberedBytesMin &&
                    path.find('\n') == std::string::npos;
  if (file_.empty() || !settled || !fits) return;
  const MutexLock lock(&mutex_);
  // A full memory is cleared: checking which of its files still exist would be slow.
  if (entries_.size() >= kRememberedFilesMax && !entries_.contains(path)) entries_.clear();
  entries_[path] = {state, digest.sha256_hex};
  changed_ = true;
}

void DigestMemory::Save() const {
  const MutexLock lock(&mutex_);
  if (!changed_) return;
  std::string text = absl::StrCat(kFirstLine, "\n");
  for (const auto& [path, entry] : entries_) {
    const FileState& state = entry.state;
    absl::StrAppend(&text, entry.sha256_hex, " ", state.size_bytes, " ", state.device, " ",
                    state.inode, " ", state.modified_ns, " ", state.changed_ns, " ", path, "\n");
  }
  MakeDirectories(file_.substr(0, file_.rfind('/'))).IgnoreError();
  WriteSecretAtomically(file_, text).IgnoreError();
}

}  // namespace sheaf::cli
