// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MakePageFile: a volume file > its page file, which renders in bounded memory. The page file is a
// pure function of the grids. A .nvdb file without compression is read page by page; the image of
// a grid of other files is in memory while its pages are made.
// SplitPageFile: a page file > files of its parts, of which a farm's worker fetches what it reads.
#pragma once

#include <cstddef>
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

// The canonical name of a part of a page file, from the file's.
std::string PagePartName(const std::string& file_name, size_t part);

// The path of a part in a folder that SplitPageFile has written.
std::string PagePartPath(const std::string& folder, size_t part);

struct PageParts {
  std::string index_path;               // A volume file, which takes the page file's place.
  std::vector<std::string> part_paths;  // At most volume::kPagePartsMax.
};

// Writes the index and the parts of a page file to a folder, which exists. A pure function of the
// page file. Errors: those of reading and writing; kInvalidArgument if it is no page file.
absl::StatusOr<PageParts> SplitPageFile(const std::string& file_name, const std::string& page_path,
                                        const std::string& folder, const VolumeLimits& limits = {});
// The number of parts of the page file that belongs to an index; none for other files.
std::optional<size_t> PagePartCount(const std::string& index_path);

// The bytes of a page file's index, which is in memory while the file is used; none if the file is
// no page file, or not whole.
std::optional<uint64_t> PageIndexBytes(const std::string& local_path);

}  // namespace sheaf
