// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/identity/file_digests.h"

#include <cerrno>
#include <filesystem>
#include <optional>
#include <system_error>
#include <tuple>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/digest.h"
#include "common/base/load_phases.h"
#include "common/base/status.h"

namespace sheaf::cli {

bool FileDigests::Key::operator<(const Key& other) const {
  return std::tie(path, size_bytes, changed.tv_sec, changed.tv_nsec) <
         std::tie(other.path, other.size_bytes, other.changed.tv_sec, other.changed.tv_nsec);
}

absl::StatusOr<FileDigests::Key> FileDigests::KeyOf(const std::string& path) {
  struct stat found {};
  if (::stat(path.c_str(), &found) != 0) return StatusFromErrno(errno, path);
  return Key{path, found.st_size, found.st_mtim};
}

absl::StatusOr<BlobDigest> FileDigests::Of(const std::string& path) {
  const PhaseTimer timer(LoadPhase::kDigests);
  const absl::StatusOr<Key> before = KeyOf(path);
  if (!before.ok()) return before.status();
  {
    const MutexLock lock(&mutex_);
    if (const auto it = digests_.find(*before); it != digests_.end()) return it->second;
  }
  std::error_code error;
  const std::string absolute = std::filesystem::absolute(path, error).string();
  const std::optional<FileState> state = StateOfFile(path);
  const bool remembers = memory_ != nullptr && !error && state.has_value();
  if (remembers) {
    if (const std::optional<BlobDigest> known = memory_->Find(absolute, *state)) return *known;
  }
  const int64_t now_ns = absl::GetCurrentTimeNanos();
  const absl::StatusOr<FileDigest> digest = Sha256OfFile(path);
  if (!digest.ok()) return digest.status();
  const absl::StatusOr<Key> after = KeyOf(path);
  if (!after.ok()) return after.status();
  if (*before < *after || *after < *before) {
    return absl::FailedPreconditionError(
        absl::StrCat(path, ": changed while it was being read; submit again"));
  }
  const BlobDigest blob{digest->sha256_hex, digest->size_bytes};
  if (remembers && StateOfFile(path) == state) memory_->Remember(absolute, *state, blob, now_ns);
  const MutexLock lock(&mutex_);
  digests_[*before] = blob;
  return blob;
}

}  // namespace sheaf::cli
