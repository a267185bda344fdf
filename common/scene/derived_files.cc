// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/derived_files.h"

#include <stdlib.h>
#include <sys/stat.h>

#include <cerrno>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/file.h"

namespace sheaf {

DerivedFiles::~DerivedFiles() {
  const MutexLock lock(&mutex_);
  std::error_code ignored;
  if (!folder_.empty()) std::filesystem::remove_all(folder_, ignored);
}

absl::Status DerivedFiles::MakeFolder() {
  if (!folder_.empty()) return absl::OkStatus();
  std::error_code error;
  const std::filesystem::path base = std::filesystem::temp_directory_path(error);
  std::string pattern = (error ? std::filesystem::path("/tmp") : base) / "sheaf-derived-XXXXXX";
  if (::mkdtemp(pattern.data()) == nullptr) {
    return absl::ErrnoToStatus(errno, absl::StrCat("cannot make the temporary folder ", pattern,
                                                   "; set TMPDIR to a folder with room"));
  }
  folder_ = pattern;
  return absl::OkStatus();
}

absl::StatusOr<std::string> DerivedFiles::Put(std::string_view bytes, std::string_view name) {
  const std::string_view::size_type dot = name.rfind('.');
  const std::string_view ending = dot == std::string_view::npos ? "" : name.substr(dot);
  const bool is_plain = ending.find('/') == std::string_view::npos && ending.size() <= 16;
  const std::string digest = Sha256Hex(bytes);
  const MutexLock lock(&mutex_);
  if (absl::Status status = MakeFolder(); !status.ok()) return status;
  std::string path = absl::StrCat(folder_, "/", digest, is_plain ? std::string(ending) : "");
  struct stat info {};
  if (::stat(path.c_str(), &info) == 0) return path;
  if (absl::Status status = WriteFileOnce(path, bytes); !status.ok()) return status;
  return path;
}

}  // namespace sheaf
