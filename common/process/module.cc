// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/process/module.h"

#include <dlfcn.h>

#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace sheaf {

const std::vector<std::string>& ModuleFolders() {
  static const std::vector<std::string> folders = [] {
    std::error_code code;
    const std::filesystem::path folder =
        std::filesystem::read_symlink("/proc/self/exe", code).parent_path();
    return std::vector<std::string>{folder.string(),
                                    (folder / "../lib/sheaf").lexically_normal().string()};
  }();
  return folders;
}

std::string FindInFolders(const std::vector<std::string>& folders, const std::string& file) {
  for (const std::string& folder : folders) {
    std::string path = (std::filesystem::path(folder) / file).string();
    std::error_code code;
    if (std::filesystem::exists(path, code)) return path;
  }
  return "";
}

absl::StatusOr<const void*> LoadModule(const std::vector<std::string>& folders,
                                       const std::string& file, const char* symbol) {
  const std::string path = FindInFolders(folders, file);
  if (path.empty()) {
    return absl::FailedPreconditionError(
        absl::StrCat(file, " is not in ", absl::StrJoin(folders, " or ")));
  }
  void* module = ::dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
  if (module == nullptr) return absl::FailedPreconditionError(::dlerror());
  const void* found = ::dlsym(module, symbol);
  if (found == nullptr) return absl::FailedPreconditionError(::dlerror());
  return found;
}

}  // namespace sheaf
