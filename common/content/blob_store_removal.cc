// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of BlobStore that lists blobs and uploads, and removes them.
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/content/blob_store.h"
#include "common/content/file_descriptor.h"

namespace sheaf {
namespace {

namespace fs = std::filesystem;

// Beyond this many, blobs without recent requests are forgotten.
constexpr size_t kAskedNotedMax = 100'000;

// Files of a folder with their sizes and ages. Unreadable ones are left out.
void ListFiles(const std::string& folder, const std::string& extension,
               std::vector<StoredBlob>* files) {
  const auto now = fs::file_time_type::clock::now();
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code ignored;
    const fs::path& path = it->path();
    if (!it->is_regular_file(ignored) || path.extension() != extension) continue;
    StoredBlob file{{path.stem().string(), it->file_size(ignored)}};
    const auto written = it->last_write_time(ignored);
    if (ignored || !CheckDigest(file.digest).ok()) continue;
    file.age = std::max(std::chrono::nanoseconds(0),
                        std::chrono::duration_cast<std::chrono::nanoseconds>(now - written));
    files->push_back(std::move(file));
  }
}

}  // namespace

std::vector<StoredBlob> BlobStore::List() const {
  std::vector<StoredBlob> blobs;
  std::error_code error;
  for (fs::directory_iterator it(directory_, error), end; !error && it != end;
       it.increment(error)) {
    if (it->path().filename().string().size() == 2) ListFiles(it->path().string(), "", &blobs);
  }
  AddObjects(&blobs);
  const Clock::time_point now = now_();
  const MutexLock lock(&asked_mutex_);
  for (StoredBlob& blob : blobs) {
    const auto asked = asked_.find(blob.digest.sha256_hex);
    if (asked == asked_.end()) continue;
    blob.age = std::min<std::chrono::nanoseconds>(blob.age, now - asked->second);
  }
  ForgetAsked(now);
  return blobs;
}

std::vector<StoredBlob> BlobStore::ListUploads() const {
  std::vector<StoredBlob> uploads;
  ListFiles(directory_ + "/partial", ".part", &uploads);
  return uploads;
}

bool BlobStore::Remove(const BlobDigest& digest) const {
  if (!CheckDigest(digest).ok()) return false;
  bool is_removed = false;
  {
    const MutexLock lock(&asked_mutex_);
    const auto asked = asked_.find(digest.sha256_hex);
    if (asked != asked_.end() && now_() - asked->second <= kAskedKept) return false;
    verified_.Forget(digest.sha256_hex);
    is_removed = ::unlink(FinalPath(digest).c_str()) == 0;
  }
  return RemoveObject(digest) || is_removed;
}

bool BlobStore::RemoveUpload(const BlobDigest& digest) const {
  if (!CheckDigest(digest).ok()) return false;
  const std::string path = PartialPath(digest);
  const FileDescriptor file(::open(path.c_str(), O_RDWR | O_CLOEXEC));
  if (!file.ok() || ::flock(file.get(), LOCK_EX | LOCK_NB) != 0) return false;
  return ::unlink(path.c_str()) == 0;
}

void BlobStore::NoteAsked(const BlobDigest& digest) const {
  const Clock::time_point now = now_();
  const MutexLock lock(&asked_mutex_);
  if (asked_.size() >= kAskedNotedMax) ForgetAsked(now);
  asked_[digest.sha256_hex] = now;
}

void BlobStore::ForgetAsked(Clock::time_point now) const {
  std::erase_if(asked_, [now](const auto& entry) { return now - entry.second > kAskedKept; });
}

bool BlobStore::HasFor(const BlobDigest& digest) const {
  NoteAsked(digest);  // First: so that it is not removed once it was found.
  if (PathOf(digest).ok()) return true;
  const MutexLock lock(&asked_mutex_);
  asked_.erase(digest.sha256_hex);
  return false;
}

}  // namespace sheaf
