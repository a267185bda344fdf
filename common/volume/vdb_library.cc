// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/vdb_library.h"

#include "absl/strings/str_cat.h"
#include "common/process/module.h"

namespace sheaf::volume {

absl::StatusOr<const VdbLibrary*> LoadVdbLibrary() {
  static const absl::StatusOr<const void*> library =
      LoadModule(ModuleFolders(), kVdbLibraryFile, kVdbLibrarySymbol);
  if (library.ok()) return static_cast<const VdbLibrary*>(*library);
  return absl::FailedPreconditionError(
      absl::StrCat(".vdb files cannot be read: ", library.status().message(),
                   "; install all of Sheaf (see its README)"));
}

}  // namespace sheaf::volume
