// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PageFile: an open page file: the list of its grids, and each as a PagedGrid. Page files are
// untrusted like other volume files: sizes are compared with the file's before memory is
// allocated, and the index with its digest.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/volume/file_bytes.h"
#include "common/volume/paged_grid.h"
#include "common/volume/volume_file.h"

namespace sheaf::volume {

class PageFile {
 public:
  // Errors: kInvalidArgument if the file is cut short or its index altered, and for another
  // version; kResourceExhausted beyond the limits.
  // kind: kPages, or kPageParts, whose parts open_part opens.
  static absl::StatusOr<PageFile> Open(const std::string& file_name, FileBytes file, FileKind kind,
                                       const VolumeLimits& limits,
                                       PartedBytes::OpenPart open_part = nullptr);

  std::vector<VolumeFileEntry> List() const;
  // Where the pages of all grids begin, in ascending order, and where the last of them ends.
  std::vector<uint64_t> PageOffsets() const;
  // Takes the index of the grid at that place in the list. Errors: those of PagedGrid::Make.
  absl::StatusOr<VolumeGrid> Take(size_t place, const VolumeLimits& limits,
                                  std::shared_ptr<VolumePages> pages);

 private:
  PageFile() = default;
  absl::Status ReadIndex(const FileBytes& file, const VolumeLimits& limits);
  absl::StatusOr<std::vector<uint64_t>> PartSizes(const FileBytes& file) const;
  absl::Status Damaged(const char* what) const;

  std::string file_name_;
  std::shared_ptr<const PartedBytes> bytes_;
  std::vector<PageIndex> grids_;
};

}  // namespace sheaf::volume
