// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MakePageFile: a volume file > its page file, which renders in bounded memory. The page file is a
// pure function of the grids. A .nvdb file without compression is read page by page; the image of
// a grid of other files is in memory while its pages are made.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/volume/volume_grid.h"

namespace sheaf {

struct PageFileSummary {
  std::vector<std::string> grids;     // Names, in the order of the file.
  std::vector<std::string> left_out;  // Names of grids that are not scalars.
  uint64_t image_bytes = 0;           // The paged grids, as they would be in memory.
  uint64_t file_bytes = 0;
};

// file_name: messages begin with it. Errors: those of ReadVolumeGrid, and of writing the file;
// kInvalidArgument if no grid can be paged, or the file is a page file.
absl::StatusOr<PageFileSummary> MakePageFile(const std::string& file_name,
                                             const std::string& local_path,
                                             const std::string& page_path,
                                             const VolumeLimits& limits = {});

// The bytes of a page file's index, which is in memory while the file is used; none if the file is
// no page file, or not whole.
std::optional<uint64_t> PageIndexBytes(const std::string& local_path);

}  // namespace sheaf
