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
#include <string_view>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "common/scene/derived_files.h"
#include "common/volume/file_bytes.h"

namespace sheaf {

// Lexical: joins a reference with the main file's directory, removes "." and "x/..".
std::string CanonicalFileName(const std::string& reference);

class FileSource {
 public:
  virtual ~FileSource() = default;
  // A path on this machine under which the file can be opened. Remembers the name for FilesUsed.
  // Errors: kNotFound, naming the file as the scene writes it.
  virtual absl::StatusOr<std::string> LocalPath(const std::string& canonical_name) = 0;
  // The same for a file that a reader takes out of another one, such as an image within a glTF
  // file. Where scenes are submitted it is written, and uploaded under this name like the others;
  // elsewhere it is there already, and bytes are not used. Errors: also those of DerivedFiles::Put.
  virtual absl::StatusOr<std::string> DerivedPath(const std::string& canonical_name,
                                                  std::string_view /*bytes*/) {
    return LocalPath(canonical_name);
  }
  // A part of a page file (volume/page_format.h), for reading. A worker fetches it now. Errors:
  // those of LocalPath, open(2) and of fetching it. Thread safety: may be called concurrently.
  virtual absl::StatusOr<volume::FileBytes> OpenPart(const std::string& canonical_name);
};

// Files below (and beside) the directory of a main scene file on this machine.
class DirectoryFileSource : public FileSource {
 public:
  // derived: where derived files go; without it there can be none.
  explicit DirectoryFileSource(std::string directory,
                               std::shared_ptr<DerivedFiles> derived = nullptr)
      : directory_(std::move(directory)), derived_(std::move(derived)) {}
  // A derived file hides one of its name in the directory.
  absl::StatusOr<std::string> LocalPath(const std::string& canonical_name) override;
  absl::StatusOr<std::string> DerivedPath(const std::string& canonical_name,
                                          std::string_view bytes) override;
  // From now on the name means that file, which was made of the one in the directory.
  void Replace(const std::string& canonical_name, const std::string& path);
  // Maps the canonical name of every file requested so far to its local path: the files that a
  // submission uploads.
  std::map<std::string, std::string> FilesUsed() const;

 private:
  std::string directory_;
  std::shared_ptr<DerivedFiles> derived_;
  mutable Mutex mutex_;
  std::map<std::string, std::string> derived_paths_ ABSL_GUARDED_BY(mutex_);
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
