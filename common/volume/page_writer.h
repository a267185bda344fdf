// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PageWriter: writes a page file from its beginning to its end, under a name of its own until it
// is whole.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "common/volume/paged_grid.h"

namespace sheaf::volume {

// Not thread-safe.
class PageWriter {
 public:
  // Errors, here and below: those of open(2), write(2), fsync(2) and rename(2), naming the file.
  static absl::StatusOr<PageWriter> Create(const std::string& path);
  PageWriter(PageWriter&& other) noexcept;
  PageWriter& operator=(PageWriter&&) = delete;
  // Removes the file unless it was finished.
  ~PageWriter();

  // Packs a page of leaves and sets where it is in *entry. Requires: !leaves.empty().
  absl::Status AddPage(std::span<const std::byte> leaves, size_t value_bytes, PageEntry* entry);
  // Writes the index of all grids, and gives the file its name.
  absl::Status Finish(std::span<const PageIndex> grids);
  uint64_t bytes() const { return offset_; }
  // The file until Finish. All pages that were added can be read.
  const std::string& part_path() const { return part_path_; }

 private:
  PageWriter() = default;
  absl::Status Write(const void* bytes, uint64_t size);

  std::string path_, part_path_;
  int descriptor_ = -1;
  uint64_t offset_ = 0;
};

}  // namespace sheaf::volume
