// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GridFiles: reads the grids that media name, each once, however many media name it.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/volume/volume_file.h"
#include "common/volume/volume_grid.h"
#include "common/volume/volume_pages.h"

namespace sheaf::render {

// Not thread-safe.
class GridFiles {
 public:
  // `files` must outlive the reader and its grids. thread_count: of the verification of a grid.
  // volume_memory_bytes_max: the limit of the memory for pages of page files.
  GridFiles(FileSource* files, int thread_count,
            uint64_t volume_memory_bytes_max = volume::VolumePages::kBytesMaxDefault)
      : files_(files),
        thread_count_(thread_count),
        pages_(std::make_shared<volume::VolumePages>(volume_memory_bytes_max)) {}

  const std::shared_ptr<volume::VolumePages>& pages() const { return pages_; }
  // The grids of a file. file: canonical name, for FileSource. Messages of errors begin with
  // `where` and the name.
  absl::StatusOr<std::vector<VolumeFileEntry>> List(const std::string& where,
                                                    const std::string& file);
  // The grid; grids that were read before share their voxels. Errors: those of ReadVolumeGrid,
  // which list the grids that are there if this one is missing.
  absl::StatusOr<VolumeGrid> Read(const std::string& where, const std::string& file,
                                  const std::string& grid);

 private:
  FileSource* files_;
  int thread_count_;
  std::shared_ptr<volume::VolumePages> pages_;
  std::map<std::pair<std::string, std::string>, VolumeGrid> grids_;  // By file, name.
};

}  // namespace sheaf::render
