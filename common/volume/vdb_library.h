// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Loads the module that uses OpenVDB when the first .vdb file is read, so that runs without one pay
// nothing. OpenVDB trusts its input, so the module runs in confined processes alone (vdb_file.h).
//
//     VdbFile > LoadVdbLibrary > libsheaf_openvdb.so > OpenVDB
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/volume/volume_file.h"
#include "common/volume/volume_surface.h"

namespace sheaf::volume {

// file: open for reading; its own position does not matter. file_name: messages begin with it.
struct VdbLibrary {
  // The grids in the order of the file, without their roles.
  absl::StatusOr<std::vector<VolumeFileEntry>> (*list)(const std::string& file_name, int file,
                                                       const VolumeLimits& limits);
  // A NanoVDB image of the grid at that place in the list, which nothing has verified.
  absl::StatusOr<VolumeBytes> (*read)(const std::string& file_name, int file, size_t index,
                                      const VolumeLimits& limits);
  // The surface of that grid, which nothing has verified (ReadVolumeSurface).
  absl::StatusOr<VolumeSurface> (*surface)(const std::string& file_name, int file, size_t index,
                                           float isovalue, const VolumeLimits& limits);
};

inline constexpr char kVdbLibraryFile[] = "libsheaf_openvdb.so";
// The module's only symbol, a VdbLibrary.
inline constexpr char kVdbLibrarySymbol[] = "sheaf_vdb_library";

// Loads the module from ModuleFolders(). Never unloaded.
// Errors: kFailedPrecondition if it is missing or incompatible.
// Thread safety: any number of threads.
absl::StatusOr<const VdbLibrary*> LoadVdbLibrary();

}  // namespace sheaf::volume
