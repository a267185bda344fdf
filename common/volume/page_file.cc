// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/page_file.h"

#include <algorithm>
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

absl::StatusOr<PageFile> PageFile::Open(const std::string& file_name, FileBytes file, FileKind kind,
                                        const VolumeLimits& limits,
                                        PartedBytes::OpenPart open_part) {
  PageFile pages;
  pages.file_name_ = file_name;
  if (absl::Status status = pages.ReadIndex(file, limits); !status.ok()) return status;
  if (kind == FileKind::kPages) {
    pages.bytes_ = std::make_shared<const PartedBytes>(std::move(file));
    return pages;
  }
  const absl::StatusOr<std::vector<uint64_t>> sizes = pages.PartSizes(file);
  if (!sizes.ok()) return sizes.status();
  pages.bytes_ = std::make_shared<const PartedBytes>(*sizes, std::move(open_part));
  return pages;
}

absl::StatusOr<std::vector<uint64_t>> PageFile::PartSizes(const FileBytes& file) const {
  uint64_t count = 0;
  std::vector<uint64_t> sizes;
  if (!file.Read(sizeof(kPartsMagic), sizeof(count), &count) || count > kPagePartsMax) {
    return Damaged("its parts are too many");
  }
  sizes.resize(count);
  if (!file.Read(sizeof(kPartsMagic) + sizeof(count), count * sizeof(uint64_t), sizes.data())) {
    return Damaged("the sizes of its parts are cut short");
  }
  uint64_t sum = 0;
  for (const uint64_t bytes : sizes) {
    if (__builtin_add_overflow(sum, bytes, &sum)) return Damaged("its parts are too large");
  }
  return sizes;
}

std::vector<uint64_t> PageFile::PageOffsets() const {
  std::vector<uint64_t> offsets;
  uint64_t end = sizeof(kPageMagic);
  for (const PageIndex& grid : grids_) {
    for (const PageEntry& entry : grid.entries) {
      if (entry.packed_bytes == 0) continue;
      offsets.push_back(entry.offset_bytes);
      end = std::max(end, entry.offset_bytes + entry.packed_bytes);
    }
  }
  std::sort(offsets.begin(), offsets.end());
  offsets.push_back(end);
  return offsets;
}

absl::Status PageFile::ReadIndex(const FileBytes& file, const VolumeLimits& limits) {
  PageTrailer trailer;
  const uint64_t size = file.size();
  if (size < sizeof(trailer) || !file.Read(size - sizeof(trailer), sizeof(trailer), &trailer) ||
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
  if (!file.Read(trailer.index_offset_bytes, bytes.size(), bytes.data()) ||
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
      PagedGrid::Make(file_name_, bytes_, std::move(grids_[place]), limits, std::move(pages));
  if (!grid.ok()) return grid.status();
  return VolumeGrid::FromPages(*std::move(grid), file_name_);
}

}  // namespace sheaf::volume
