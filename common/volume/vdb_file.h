// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Reads OpenVDB's .vdb files without OpenVDB, which trusts its input: trees of float and of three
// floats, in full or half precision, with every compression OpenVDB writes. Files since version 222
// of the format (OpenVDB 1.0, 2013). Source: the format as OpenVDB's io/Archive.h, io/Compression.h
// and tree/*.h define it.
#pragma once

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/volume/volume_file.h"

namespace sheaf::volume {

bool BeginsAsVdb(uint64_t first_eight_bytes);

struct VdbEntry : VolumeFileEntry {
  std::string grid_type;
  std::string instance_of;
  bool is_half = false;
  uint64_t end_bytes = 0;
};
// bytes: the whole file.
absl::StatusOr<std::vector<VdbEntry>> ListVdb(const std::string& file_name,
                                              const std::string& bytes, const VolumeLimits& limits);
absl::StatusOr<VolumeGrid> ReadVdbGrid(const std::string& file_name, const std::string& bytes,
                                       const VdbEntry& entry, const VolumeLimits& limits,
                                       int thread_count);

}  // namespace sheaf::volume
