// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DerivedFiles: files that are made from a scene's files before it is submitted, such as the images
// within a glTF file, in a temporary folder that ends with this object.
#pragma once

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"

namespace sheaf {

// Thread safety: members may be called concurrently.
class DerivedFiles {
 public:
  DerivedFiles() = default;
  // Removes the folder with all files.
  ~DerivedFiles();
  DerivedFiles(const DerivedFiles&) = delete;
  DerivedFiles& operator=(const DerivedFiles&) = delete;

  // The path of a file of these bytes that ends like `name`. Equal bytes give the same file.
  // Errors: kResourceExhausted, kPermissionDenied and the like if it cannot be written.
  absl::StatusOr<std::string> Put(std::string_view bytes, std::string_view name);

 private:
  absl::Status MakeFolder() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  Mutex mutex_;
  std::string folder_ ABSL_GUARDED_BY(mutex_);  // Empty until the first file.
};

}  // namespace sheaf
