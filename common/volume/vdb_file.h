// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// VdbFile: an OpenVDB .vdb file. OpenVDB trusts its input, so it reads the files of strangers in
// confined processes alone: in this one, if it is confined itself, as the process of a scene is;
// otherwise in one that lives as long as the object (vdb_process.h).
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/volume/file_bytes.h"
#include "common/volume/volume_file.h"
#include "common/volume/volume_surface.h"

namespace sheaf::volume {

bool BeginsAsVdb(uint64_t first_eight_bytes);

inline std::atomic<bool> vdb_is_read_in_this_process = false;
// For a process that is confined, and may start no other.
inline void ReadVdbInThisProcess() { vdb_is_read_in_this_process = true; }

class VdbFile {
 public:
  // file_name: messages begin with it. file: must outlive the object.
  // Errors: kFailedPrecondition if a part of Sheaf is missing; kUnavailable if no process can be
  // started.
  static absl::StatusOr<std::unique_ptr<VdbFile>> Open(const std::string& file_name,
                                                       const FileBytes& file,
                                                       const VolumeLimits& limits);
  virtual ~VdbFile() = default;

  // The grids in the order of the file. Errors: those of ListVolumeFile.
  virtual absl::StatusOr<std::vector<VolumeFileEntry>> List() = 0;
  // An unverified image of the grid at that place in the list. Errors: those of ReadVolumeGrid.
  virtual absl::StatusOr<VolumeBytes> Read(size_t index) = 0;
  // An unverified surface of that grid. Errors: those of ReadVolumeSurface.
  virtual absl::StatusOr<VolumeSurface> Surface(size_t index, float isovalue) = 0;
};

}  // namespace sheaf::volume
