// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/image_library.h"

#include <dlfcn.h>

#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace sheaf {
namespace {

absl::Status CannotLoad(const std::string& why) {
  return absl::FailedPreconditionError(
      absl::StrCat("images cannot be read: ", why, "; install all of Sheaf (see its README)"));
}

}  // namespace

absl::StatusOr<const ImageLibrary*> LoadImageLibraryFrom(const std::vector<std::string>& folders) {
  for (const std::string& folder : folders) {
    const std::string path = (std::filesystem::path(folder) / kImageLibraryFile).string();
    std::error_code code;
    if (!std::filesystem::exists(path, code)) continue;
    void* module = dlopen(path.c_str(), RTLD_NOW | RTLD_LOCAL);
    if (module == nullptr) return CannotLoad(dlerror());
    const void* library = dlsym(module, kImageLibrarySymbol);
    if (library == nullptr) return CannotLoad(dlerror());
    return static_cast<const ImageLibrary*>(library);
  }
  return CannotLoad(absl::StrCat(kImageLibraryFile, " is not in ", absl::StrJoin(folders, " or ")));
}

const std::vector<std::string>& ImageLibraryFolders() {
  static const std::vector<std::string> folders = [] {
    std::error_code code;
    const std::filesystem::path folder =
        std::filesystem::read_symlink("/proc/self/exe", code).parent_path();
    return std::vector<std::string>{folder.string(),
                                    (folder / "../lib/sheaf").lexically_normal().string()};
  }();
  return folders;
}

absl::StatusOr<const ImageLibrary*> LoadImageLibrary() {
  static const absl::StatusOr<const ImageLibrary*> library =
      LoadImageLibraryFrom(ImageLibraryFolders());
  return library;
}

}  // namespace sheaf
