// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/grid_files.h"

#include "absl/strings/str_cat.h"
#include "common/volume/page_maker.h"

namespace sheaf::render {

absl::StatusOr<std::vector<VolumeFileEntry>> GridFiles::List(const std::string& where,
                                                             const std::string& file) {
  const auto path = files_->LocalPath(file);
  if (!path.ok()) return path.status();
  return ListVolumeFile(absl::StrCat(where, ": ", file), *path);
}

absl::StatusOr<VolumeGrid> GridFiles::Read(const std::string& where, const std::string& file,
                                           const std::string& grid) {
  const auto known = grids_.find(std::pair{file, grid});
  if (known != grids_.end()) return known->second;
  const auto path = files_->LocalPath(file);
  if (!path.ok()) return path.status();
  const auto open_part = [files = files_, file](size_t part) {
    return files->OpenPart(PagePartName(file, part));
  };
  auto read = ReadVolumeGrid(absl::StrCat(where, ": ", file), *path, grid, {}, thread_count_,
                             pages_, open_part);
  if (read.ok()) grids_.emplace(std::pair{file, grid}, *read);
  return read;
}

}  // namespace sheaf::render
