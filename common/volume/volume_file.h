// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Volume grids from files: NanoVDB's .nvdb, OpenVDB's .vdb and page files (page_maker.h),
// distinguished by their first bytes. All are untrusted. Sizes of a .nvdb file are compared with
// the file's and with the limits before memory is allocated; OpenVDB reads a .vdb file in a
// confined process (vdb_file.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/volume/file_bytes.h"
#include "common/volume/volume_grid.h"

namespace sheaf {

// One grid of a file, as the file describes it.
struct VolumeFileEntry {
  std::string name;  // Numbered from the second grid of one name on: NumberSharedNames.
  VolumeRole role = VolumeRole::kOther;
  std::string type_name;  // The file's name for the type of values.
  bool can_be_read = false;
  uint64_t offset_bytes = 0;  // The place of the grid's data; only .nvdb.
};

namespace volume {
class OpenVolume;
class VolumePages;

// kPageParts: a page file whose pages are in other files (page_format.h).
enum class FileKind { kNvdb, kVdb, kPages, kPageParts };
// Errors: kInvalidArgument if it is none of them.
absl::StatusOr<FileKind> KindOf(const std::string& file_name, const FileBytes& file);
}  // namespace volume

// file_name: as the scene writes it; messages begin with it.
// Errors: kNotFound; kInvalidArgument if it is neither kind of file; kDataLoss if it is truncated
// or damaged; kResourceExhausted beyond the limits.
absl::StatusOr<std::vector<VolumeFileEntry>> ListVolumeFile(const std::string& file_name,
                                                            const std::string& local_path,
                                                            const VolumeLimits& limits = {});

// The grid of that name. pages: the memory of a page file's pages; if null, the grid has its
// own, of VolumePages::kBytesMaxDefault. open_part: opens the parts of a page file that is in
// parts. Errors: as ListVolumeFile; also kNotFound, listing the names in the file; kInvalidArgument
// for unsupported types (points, ...).
absl::StatusOr<VolumeGrid> ReadVolumeGrid(const std::string& file_name,
                                          const std::string& local_path,
                                          const std::string& grid_name,
                                          const VolumeLimits& limits = {}, int thread_count = 1,
                                          std::shared_ptr<volume::VolumePages> pages = nullptr,
                                          volume::PartedBytes::OpenPart open_part = nullptr);

// Files that stay open, the first ones; a .vdb file is a process. Others are opened each time.
inline constexpr size_t kKeptVolumesMax = 64;
// A larger grid that is read whole is not kept.
inline constexpr uint64_t kKeptGridBytesMax = uint64_t{16} << 20;

// For those who ask several questions about a scene: each file is opened once, and its grids are
// read once. Not thread-safe.
class VolumeReader {
 public:
  VolumeReader();
  ~VolumeReader();
  VolumeReader(const VolumeReader&) = delete;
  VolumeReader& operator=(const VolumeReader&) = delete;

  // Arguments and errors, here and below: those of ListVolumeFile and ReadVolumeGrid. Messages have
  // the name by which a file was opened first.
  absl::StatusOr<std::vector<VolumeFileEntry>> List(const std::string& file_name,
                                                    const std::string& local_path);
  absl::StatusOr<VolumeGrid> Read(const std::string& file_name, const std::string& local_path,
                                  const std::string& grid_name);
  // How often a file was opened so far.
  uint64_t open_count() const { return open_count_; }

 private:
  using Opened = absl::StatusOr<std::shared_ptr<volume::OpenVolume>>;
  Opened Open(const std::string& file_name, const std::string& local_path);

  uint64_t open_count_ = 0;
  std::map<std::string, Opened> files_;  // By local path.
  // By local path and name.
  std::map<std::pair<std::string, std::string>, absl::StatusOr<VolumeGrid>> grids_;
};

}  // namespace sheaf
