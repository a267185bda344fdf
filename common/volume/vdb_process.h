// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// OpenVdbInProcess: reads a .vdb file in sheaf-vdb-reader, a process that has nothing but the open
// file and a socket, and whose answers are verified. A file that breaks OpenVDB ends that process
// alone, and is one error here.
//
//     OpenVdbInProcess (this process) | socket | sheaf-vdb-reader > VdbLibrary
#pragma once

#include <cstdint>
#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "common/volume/vdb_file.h"

namespace sheaf::volume {

// Limits of the process. Its memory holds a grid twice, as OpenVDB has it and as NanoVDB does,
// besides the libraries.
constexpr uint64_t VdbReaderMemoryBytesMax(const VolumeLimits& limits) {
  return 2 * limits.grid_bytes_max + (uint64_t{1} << 30);
}
inline constexpr uint32_t kVdbReaderCpuSecondsMax = 1'800;

// See VdbFile::Open.
absl::StatusOr<std::unique_ptr<VdbFile>> OpenVdbInProcess(const std::string& file_name,
                                                          const FileBytes& file,
                                                          const VolumeLimits& limits);

}  // namespace sheaf::volume
