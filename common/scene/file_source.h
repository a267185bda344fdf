// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FileSource: access to the files of a scene. The client reads a directory; a worker reads its
// content cache by digest. Names are canonical: relative to the main scene file's directory with
// forward slashes ("models/a.ply", "../shared/b.png"), or absolute exactly as the scene writes
// them.
#pragma once

#include <map>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"

namespace sheaf {

// Lexical: joins a reference with the main file's directory, removes "." and "x/..".
std::string CanonicalFileName(const std::string& reference);

class FileSource {
 public:
  virtual ~FileSource() = default;
  // A path on this machine under which the file can be opened. Remembers the name for FilesUsed.
  // Errors: kNotFound, naming the file as the scene writes it.
  virtual absl::StatusOr<std::string> LocalPath(const std::string& canonical_name) = 0;
};

// Files below (and beside) the directory of a main scene file on this machine.
class DirectoryFileSource : public FileSource {
 public:
  explicit DirectoryFileSource(std::string directory) : directory_(std::move(directory)) {}
  absl::StatusOr<std::string> LocalPath(const std::string& canonical_name) override;
  // Maps the canonical name of every file requested so far to its local path: the files that a
  // submission uploads.
  std::map<std::string, std::string> FilesUsed() const;

 private:
  std::string directory_;
  mutable Mutex mutex_;
  std::map<std::string, std::string> files_used_ ABSL_GUARDED_BY(mutex_);
};

// A fixed table from canonical names to local paths (a worker's cache; tests).
class TableFileSource : public FileSource {
 public:
  explicit TableFileSource(std::map<std::string, std::string> local_paths)
      : local_paths_(std::move(local_paths)) {}
  absl::StatusOr<std::string> LocalPath(const std::string& canonical_name) override;

 private:
  std::map<std::string, std::string> local_paths_;
};

}  // namespace sheaf
