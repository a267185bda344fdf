// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/sandbox/readable_paths.h"

#include <cstdlib>
#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_split.h"
#include "common/process/module.h"
#include "common/image/image_library.h"
#include "common/volume/vdb_library.h"

namespace sheaf::worker {

std::vector<std::string> LibraryPaths() {
  // Debian leads from libraries of several makers (BLAS) to one of them by /etc/alternatives.
  std::vector<std::string> candidates = {
      "/usr", "/lib", "/lib32", "/lib64", "/etc/ld.so.cache", "/etc/alternatives"};
  if (const char* folders = std::getenv("LD_LIBRARY_PATH"); folders != nullptr) {
    for (const std::string& folder : std::vector<std::string>(absl::StrSplit(folders, ':'))) {
      if (folder.starts_with('/') && folder != "/") candidates.emplace_back(folder);
    }
  }
  for (const std::string& folder : ModuleFolders()) {
    candidates.push_back(absl::StrCat(folder, "/", kImageLibraryFile));
    candidates.push_back(absl::StrCat(folder, "/", volume::kVdbLibraryFile));
  }
  std::vector<std::string> paths;
  for (const std::string& candidate : candidates) {
    std::error_code error;
    if (std::filesystem::exists(candidate, error)) paths.push_back(candidate);
  }
  return paths;
}

}  // namespace sheaf::worker
