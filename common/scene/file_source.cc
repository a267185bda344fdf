// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/file_source.h"

#include <sys/stat.h>

#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/surroundings/similar_file.h"

namespace sheaf {
namespace {

// A backslash between folders stays itself, or becomes an escape such as that of a tab.
constexpr std::string_view kTracesOfBackslashes = "\\\b\f\n\r\t";

absl::Status NotFound(const std::string& name, const std::string& why) {
  const bool has_backslash = name.find_first_of(kTracesOfBackslashes) != std::string::npos;
  return absl::NotFoundError(absl::StrCat(
      "file \"", name, "\" ", why,
      has_backslash ? "; its name is written with a backslash, between folders write /" : ""));
}

// Only regular files are read: others have no end, or wait for another process.
absl::Status CheckRegular(const std::string& name, mode_t mode) {
  if (S_ISREG(mode)) return absl::OkStatus();
  if (S_ISDIR(mode)) return NotFound(name, "is a directory, not a file");
  const char* const kind = S_ISFIFO(mode) ? "a pipe" : S_ISSOCK(mode) ? "a socket" : "a device";
  return NotFound(name, absl::StrCat("is ", kind, ", not a regular file; copy its bytes into one"));
}

std::string JoinPath(const std::string& directory, const std::string& name) {
  if (name.empty() || name.front() == '/' || directory.empty()) return name;
  return directory.back() == '/' ? directory + name : directory + "/" + name;
}

}  // namespace

std::string CanonicalFileName(const std::string& reference) {
  if (reference.empty() || reference.front() == '/') return reference;
  std::vector<std::string> parts;
  size_t begin = 0;
  while (begin <= reference.size()) {
    size_t end = reference.find('/', begin);
    if (end == std::string::npos) end = reference.size();
    std::string part = reference.substr(begin, end - begin);
    begin = end + 1;
    if (part.empty() || part == ".") continue;
    // "x/.." vanishes; a leading ".." stays, as nothing before it can be removed.
    if (part == ".." && !parts.empty() && parts.back() != "..") {
      parts.pop_back();
      continue;
    }
    parts.push_back(std::move(part));
  }
  return absl::StrJoin(parts, "/");
}

absl::StatusOr<volume::FileBytes> FileSource::OpenPart(const std::string& canonical_name) {
  const absl::StatusOr<std::string> path = LocalPath(canonical_name);
  if (!path.ok()) return path.status();
  return volume::FileBytes::Open(canonical_name, *path);
}

absl::StatusOr<std::string> DirectoryFileSource::LocalPath(const std::string& canonical_name) {
  if (canonical_name.empty())
    return NotFound(canonical_name, "cannot be opened: its name is empty");
  {
    const MutexLock lock(&mutex_);
    const auto derived = derived_paths_.find(canonical_name);
    if (derived != derived_paths_.end()) return derived->second;
  }
  std::string path = JoinPath(directory_, canonical_name);
  struct stat info {};
  if (::stat(path.c_str(), &info) != 0) {
    return NotFound(canonical_name,
                    absl::StrCat("does not exist (looked for ", path, ")", SimilarFileHint(path)));
  }
  if (absl::Status status = CheckRegular(canonical_name, info.st_mode); !status.ok()) return status;
  const MutexLock lock(&mutex_);
  files_used_[canonical_name] = path;
  return path;
}

absl::StatusOr<std::string> DirectoryFileSource::DerivedPath(const std::string& canonical_name,
                                                             std::string_view bytes) {
  if (derived_ == nullptr) return LocalPath(canonical_name);
  absl::StatusOr<std::string> path = derived_->Put(bytes, canonical_name);
  if (path.ok()) Replace(canonical_name, *path);
  return path;
}

void DirectoryFileSource::Replace(const std::string& canonical_name, const std::string& path) {
  const MutexLock lock(&mutex_);
  derived_paths_[canonical_name] = path;
  files_used_[canonical_name] = path;
}

std::map<std::string, std::string> DirectoryFileSource::FilesUsed() const {
  const MutexLock lock(&mutex_);
  return files_used_;
}

absl::StatusOr<std::string> TableFileSource::LocalPath(const std::string& canonical_name) {
  const auto found = local_paths_.find(canonical_name);
  if (found == local_paths_.end()) {
    return NotFound(canonical_name, "is not among the files of this scene");
  }
  struct stat info {};
  if (::stat(found->second.c_str(), &info) == 0) {
    if (absl::Status status = CheckRegular(canonical_name, info.st_mode); !status.ok()) {
      return status;
    }
  }
  return found->second;
}

}  // namespace sheaf
