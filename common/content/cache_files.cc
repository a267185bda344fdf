// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/content/cache_files.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <set>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace sheaf {

namespace fs = std::filesystem;

bool UsedBefore(const Evictable& a, const Evictable& b) {
  if (a.used.tv_sec != b.used.tv_sec) return a.used.tv_sec < b.used.tv_sec;
  if (a.used.tv_nsec != b.used.tv_nsec) return a.used.tv_nsec < b.used.tv_nsec;
  return a.path < b.path;
}

std::vector<std::string> ListDirectory(const std::string& path) {
  std::vector<std::string> names;
  std::error_code error;
  for (fs::directory_iterator it(path, error), end; !error && it != end; it.increment(error)) {
    names.push_back(it->path().filename().string());
  }
  return names;
}

FileDescriptor LockIfFree(const std::string& path) {
  FileDescriptor file(::open(path.c_str(), O_RDWR | O_CLOEXEC));
  if (file.ok() && ::flock(file.get(), LOCK_EX | LOCK_NB) != 0) file.Close();
  return file;
}

uint64_t SizeOf(const std::string& path) {
  struct stat found {};
  return ::stat(path.c_str(), &found) == 0 ? static_cast<uint64_t>(found.st_size) : 0;
}

std::string StampPath(const std::string& cache, const std::string& sha256_hex) {
  return absl::StrCat(cache, "/used/", sha256_hex);
}

std::vector<std::string> LeaseDirectories(const std::string& cache) {
  const std::string leases = absl::StrCat(cache, "/leases/");
  std::vector<std::string> directories;
  for (const std::string& user : ListDirectory(leases)) {
    for (const std::string& name : ListDirectory(absl::StrCat(leases, user))) {
      directories.push_back(absl::StrCat(leases, user, "/", name));
    }
  }
  return directories;
}

namespace {

// Digests of the blobs that leases link to.
std::set<std::string> PinnedBlobs(const std::string& cache) {
  std::set<std::string> pinned;
  for (const std::string& directory : LeaseDirectories(cache)) {
    for (const std::string& name : ListDirectory(directory)) {
      std::error_code error;
      const fs::path blob = fs::read_symlink(absl::StrCat(directory, "/", name), error);
      if (!error) pinned.insert(blob.filename().string());
    }
  }
  return pinned;
}

}  // namespace

void ScanBlobs(const std::string& cache, const std::string& blobs, uint64_t* used_bytes,
               std::vector<Evictable>* evictable) {
  const std::set<std::string> pinned = PinnedBlobs(cache);
  for (const std::string& folder : ListDirectory(blobs)) {
    if (folder.size() != 2) continue;
    for (const std::string& name : ListDirectory(absl::StrCat(blobs, "/", folder))) {
      const std::string path = absl::StrCat(blobs, "/", folder, "/", name);
      struct stat found {};
      if (::stat(path.c_str(), &found) != 0) continue;
      const auto size = static_cast<uint64_t>(found.st_size);
      *used_bytes += size;
      if (pinned.contains(name)) continue;
      struct stat used {};
      const bool stamped = ::stat(StampPath(cache, name).c_str(), &used) == 0;
      evictable->push_back({stamped ? used.st_mtim : found.st_mtim, path, size, false});
    }
  }
  for (const std::string& name : ListDirectory(absl::StrCat(blobs, "/damaged"))) {
    const std::string path = absl::StrCat(blobs, "/damaged/", name);
    *used_bytes += SizeOf(path);
    evictable->push_back({timespec{}, path, SizeOf(path), false});
  }
  for (const std::string& name : ListDirectory(absl::StrCat(blobs, "/partial"))) {
    const std::string path = absl::StrCat(blobs, "/partial/", name);
    struct stat found {};
    // A download in progress is counted by its lease's reservation.
    if (!LockIfFree(path).ok() || ::stat(path.c_str(), &found) != 0) continue;
    *used_bytes += static_cast<uint64_t>(found.st_size);
    evictable->push_back({found.st_mtim, path, static_cast<uint64_t>(found.st_size), true});
  }
}

bool Evict(const Evictable& victim) {
  FileDescriptor lock;
  if (victim.partial) {
    lock = LockIfFree(victim.path);
    if (!lock.ok()) return false;
  }
  return ::unlink(victim.path.c_str()) == 0;
}

}  // namespace sheaf
