// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads .nvdb files; volume_file.h describes arguments and errors. Source: the layout as NanoVDB's
// IO.h documents it (segments of a header, entries and data).
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/volume/file_bytes.h"
#include "common/volume/volume_file.h"

namespace sheaf::volume {

struct NvdbEntry : VolumeFileEntry {
  uint64_t grid_bytes = 0, file_bytes = 0;
  uint16_t codec = 0;  // 0: the image is in the file as it is.
};
absl::StatusOr<std::vector<NvdbEntry>> ListNvdb(const std::string& file_name, const FileBytes& file,
                                                const VolumeLimits& limits);
absl::StatusOr<VolumeGrid> ReadNvdbGrid(const std::string& file_name, const FileBytes& file,
                                        const NvdbEntry& entry, const VolumeLimits& limits,
                                        int thread_count);

// The grid's image, which nothing has verified. Errors: those of ReadVolumeGrid.
absl::StatusOr<VolumeBytes> ReadNvdbImage(const std::string& file_name, const FileBytes& file,
                                          const NvdbEntry& entry, const VolumeLimits& limits);
}  // namespace sheaf::volume
