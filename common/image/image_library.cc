// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/image/image_library.h"

#include "absl/strings/str_cat.h"
#include "common/process/module.h"

namespace sheaf {

absl::StatusOr<const ImageLibrary*> LoadImageLibraryFrom(const std::vector<std::string>& folders) {
  const absl::StatusOr<const void*> library =
      LoadModule(folders, kImageLibraryFile, kImageLibrarySymbol);
  if (library.ok()) return static_cast<const ImageLibrary*>(*library);
  return absl::FailedPreconditionError(
      absl::StrCat("images cannot be read: ", library.status().message(),
                   "; install all of Sheaf (see its README)"));
}

absl::StatusOr<const ImageLibrary*> LoadImageLibrary() {
  static const absl::StatusOr<const ImageLibrary*> library = LoadImageLibraryFrom(ModuleFolders());
  return library;
}

}  // namespace sheaf
