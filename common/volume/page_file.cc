// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/page_file.h"

#include <cstring>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"

namespace sheaf::volume {
namespace {

// Takes `count` values from the front of *bytes. False if there are fewer.
template <typename T>
bool TakeValues(std::string_view* bytes, size_t count, std::vector<T>* values) {
  static_assert(std::is_trivially_copyable_v<T>);
  if (bytes->size() / sizeof(T) < count) return false;
  values->resize(count);
  if (count > 0) std::memcpy(static_cast<void*>(values->data()), bytes->data(), count * sizeof(T));
  bytes->remove_prefix(count * sizeof(T));
  return true;
}

}  // namespace

absl::Status PageFile::Damaged(const char* what) const {
  return absl::InvalidArgumentError(
      absl::StrCat(file_name_, ": ", what,
                   ": the page file is altered or cut short; make it again "
                   "(sheaf pack)"));
}

absl::StatusOr<PageFile> PageFile::Open(const std::string& file_name, FileBytes file,
                                        const VolumeLimits& limits) {
  PageFile pages;
  pages.file_name_ = file_name;
  pages.file_ = std::make_shared<const FileBytes>(std::move(file));
  const absl::Status status = pages.ReadIndex(limits);
  if (!status.ok()) return status;
  return pages;
}

absl::Status PageFile::ReadIndex(const VolumeLimits& limits) {
  PageTrailer trailer;
  const uint64_t size = file_->size();
  if (size < sizeof(trailer) || !file_->Read(size - sizeof(trailer), sizeof(trailer), &trailer) ||
      trailer.magic != kPageMagic) {
    return Damaged("has no end");
  }
  if (trailer.version != kPageVersion) {
    return absl::InvalidArgumentError(absl::StrCat(file_name_, ": is a page file of version ",
                                                   trailer.version, ", only ", kPageVersion,
                                                   " can be read; make it again (sheaf pack)"));
  }
  if (trailer.grid_count > static_cast<uint32_t>(limits.grid_count_max)) {
    return absl::ResourceExhaustedError(
        absl::StrCat(file_name_, ": more than ", limits.grid_count_max, " grids (grid_count_max)"));
  }
  const uint64_t end = size - sizeof(trailer);
  if (trailer.index_offset_bytes > end || end - trailer.index_offset_bytes != trailer.index_bytes) {
    return Damaged("its index lies outside");
  }
  if (trailer.index_bytes > limits.grid_bytes_max) {
    return absl::ResourceExhaustedError(absl::StrCat(file_name_, ": its index takes ",
                                                     trailer.index_bytes, " bytes, more than ",
                                                     limits.grid_bytes_max, " (grid_bytes_max)"));
  }
  std::string bytes(trailer.index_bytes, '\0');
  if (!file_->Read(trailer.index_offset_bytes, bytes.size(), bytes.data()) ||
      Sha256Hex(bytes) !=
          std::string_view(trailer.index_sha256.data(), trailer.index_sha256.size())) {
    return Damaged("its index does not match its digest");
  }
  std::string_view rest = bytes;
  for (uint32_t i = 0; i < trailer.grid_count; ++i) {
    std::vector<PageGridHead> head;
    PageIndex grid;
    if (!TakeValues(&rest, 1, &head)) return Damaged("its index is cut short");
    grid.head = head[0];
    grid.head.name.back() = 0;
    if (!TakeValues(&rest, grid.head.root_tile_count, &grid.root_tiles) ||
        !TakeValues(&rest, grid.head.region_count, &grid.regions) ||
        !TakeValues(&rest, grid.head.page_count, &grid.entries)) {
      return Damaged("its index is cut short");
    }
    grids_.push_back(std::move(grid));
  }
  return rest.empty() ? absl::OkStatus() : Damaged("its index is too long");
}

std::vector<VolumeFileEntry> PageFile::List() const {
  static constexpr const char* kTypeNames[] = {"float", "Float4", "Float8", "Float16", "FloatN"};
  std::vector<VolumeFileEntry> entries;
  for (const PageIndex& grid : grids_) {
    VolumeFileEntry entry;
    entry.name = grid.head.name.data();
    entry.role = VolumeRoleOf(entry.name);
    entry.can_be_read = grid.head.type < std::size(kTypeNames);
    entry.type_name = entry.can_be_read ? kTypeNames[grid.head.type] : "unknown";
    entries.push_back(std::move(entry));
  }
  return entries;
}

absl::StatusOr<VolumeGrid> PageFile::Take(size_t place, const VolumeLimits& limits,
                                          std::shared_ptr<VolumePages> pages) {
  auto grid =
      PagedGrid::Make(file_name_, file_, std::move(grids_[place]), limits, std::move(pages));
  if (!grid.ok()) return grid.status();
  return VolumeGrid::FromPages(*std::move(grid), file_name_);
}

}  // namespace sheaf::volume
