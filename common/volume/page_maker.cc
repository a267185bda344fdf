// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/page_maker.h"

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "common/base/file.h"
#include "common/volume/file_bytes.h"
#include "common/volume/grid_pager.h"
#include "common/volume/image_source.h"
#include "common/volume/nanovdb_verify.h"
#include "common/volume/nvdb_file.h"
#include "common/volume/page_file.h"
#include "common/volume/page_writer.h"
#include "common/volume/paged_grid.h"
#include "common/volume/vdb_file.h"
#include "common/volume/volume_file.h"
#include "common/volume/volume_pages.h"

namespace sheaf {
namespace {

class PageFileMaker {
 public:
  PageFileMaker(const std::string& file_name, const VolumeLimits& limits, volume::PageWriter writer)
      : file_name_(file_name), limits_(limits), writer_(std::move(writer)) {}

  absl::Status MakeFromNvdb(const volume::FileBytes& file) {
    const auto entries = volume::ListNvdb(file_name_, file, limits_);
    if (!entries.ok()) return entries.status();
    for (const volume::NvdbEntry& entry : *entries) {
      if (!CanBeRead(entry)) continue;
      absl::Status status;
      if (entry.codec == 0 && entry.grid_bytes <= entry.file_bytes) {
        status = Add(entry, volume::ImageSource(file, entry.offset_bytes, entry.grid_bytes));
      } else {
        auto image = volume::ReadNvdbImage(file_name_, file, entry, limits_);
        status = image.ok() ? Add(entry, volume::ImageSource(*std::move(image))) : image.status();
      }
      if (!status.ok()) return status;
    }
    return Finish();
  }

  absl::Status MakeFromVdb(const volume::FileBytes& file) {
    const auto vdb = volume::VdbFile::Open(file_name_, file, limits_);
    if (!vdb.ok()) return vdb.status();
    const auto entries = (*vdb)->List();
    if (!entries.ok()) return entries.status();
    for (size_t i = 0; i < entries->size(); ++i) {
      if (!CanBeRead((*entries)[i])) continue;
      auto image = (*vdb)->Read(i);
      if (!image.ok()) return image.status();
      const absl::Status status = Add((*entries)[i], volume::ImageSource(*std::move(image)));
      if (!status.ok()) return status;
    }
    return Finish();
  }

  PageFileSummary TakeSummary() { return std::move(summary_); }

 private:
  bool CanBeRead(const VolumeFileEntry& entry) {
    if (!entry.can_be_read) summary_.left_out.push_back(entry.name);
    return entry.can_be_read;
  }

  absl::Status Add(const VolumeFileEntry& entry, volume::ImageSource image) {
    std::array<std::byte, sizeof(nanovdb::GridData) + sizeof(nanovdb::TreeData<3>)> head;
    if (!image.Read(0, head.size(), head.data())) {
      return absl::DataLossError(absl::StrCat(file_name_, ": grid \"", entry.name,
                                              "\" is cut short; write the file again"));
    }
    auto info = volume::VerifyHead(head, image.size(), file_name_, limits_);
    if (!info.ok()) return info.status();
    if (info->type == VolumeValueType::kVec3f) {
      summary_.left_out.push_back(entry.name);
      return absl::OkStatus();
    }
    info->name = entry.name;
    auto index = volume::WithScalarType(info->type, [&]<typename BuildT>() {
      return volume::GridPager<BuildT>(file_name_, limits_, &*info, &image, &writer_).Run();
    });
    if (!index.ok()) return index.status();
    if (absl::Status status = FindMean(&*index); !status.ok()) return status;
    indices_.push_back(*std::move(index));
    summary_.grids.push_back(entry.name);
    summary_.image_bytes += image.size();
    return absl::OkStatus();
  }

  // The mean from the pages that are written already, as those who read the file would find it.
  absl::Status FindMean(volume::PageIndex* index) const {
    constexpr uint64_t kBytesMax = uint64_t{16} << 20;
    auto file = volume::FileBytes::Open(file_name_, writer_.part_path());
    if (!file.ok()) return file.status();
    const auto pages = std::make_shared<volume::VolumePages>(kBytesMax);
    auto paged = volume::PagedGrid::Make(
        file_name_, std::make_shared<const volume::PartedBytes>(*std::move(file)), *index, limits_,
        pages);
    if (!paged.ok()) return paged.status();
    const auto grid = VolumeGrid::FromPages(*std::move(paged), file_name_);
    if (!grid.ok()) return grid.status();
    if (!index->regions.empty()) {  // Otherwise it has no pages.
      const double mean = grid->MeanValue();
      index->head.mean = static_cast<float>(mean);
      index->regions[0].mean_rest = static_cast<float>(mean - double{index->head.mean});
    }
    return pages->status();
  }

  absl::Status Finish() {
    if (indices_.empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat(file_name_,
                       ": has no grid of scalars, which alone are read by pages; use the file "
                       "itself"));
    }
    const absl::Status status = writer_.Finish(indices_);
    summary_.file_bytes = writer_.bytes();
    return status;
  }

  const std::string& file_name_;
  const VolumeLimits& limits_;
  volume::PageWriter writer_;
  std::vector<volume::PageIndex> indices_;
  PageFileSummary summary_;
};

}  // namespace

absl::StatusOr<PageFileSummary> MakePageFile(const std::string& file_name,
                                             const std::string& local_path,
                                             const std::string& page_path,
                                             const VolumeLimits& limits) {
  const auto file = volume::FileBytes::Open(file_name, local_path);
  if (!file.ok()) return file.status();
  const auto kind = volume::KindOf(file_name, *file);
  if (!kind.ok()) return kind.status();
  if (*kind == volume::FileKind::kPages || *kind == volume::FileKind::kPageParts) {
    return absl::InvalidArgumentError(
        absl::StrCat(file_name, ": is a page file already; scenes can name it as it is"));
  }
  auto writer = volume::PageWriter::Create(page_path);
  if (!writer.ok()) return writer.status();
  PageFileMaker maker(file_name, limits, *std::move(writer));
  const absl::Status status =
      *kind == volume::FileKind::kVdb ? maker.MakeFromVdb(*file) : maker.MakeFromNvdb(*file);
  if (!status.ok()) return status;
  return maker.TakeSummary();
}

std::string PagePartName(const std::string& file_name, size_t part) {
  return PagePartPath(file_name + ".parts", part);
}

std::string PagePartPath(const std::string& folder, size_t part) {
  return absl::StrFormat("%s/%04d", folder, part);
}

namespace {

// Bytes of a page file, as a string.
absl::StatusOr<std::string> Bytes(const std::string& file_name, const volume::FileBytes& file,
                                  uint64_t begin, uint64_t end) {
  std::string bytes(end - begin, '\0');
  if (file.Read(begin, bytes.size(), bytes.data())) return bytes;
  return absl::DataLossError(absl::StrCat(file_name, ": cannot be read; make it again"));
}

// Where parts end. offsets: of the pages, and their end.
std::vector<uint64_t> PartEnds(const std::vector<uint64_t>& offsets) {
  const uint64_t end = offsets.back();
  const uint64_t least =
      std::max(volume::kPartBytesMin, (end + volume::kPagePartsMax - 1) / volume::kPagePartsMax);
  std::vector<uint64_t> ends;
  uint64_t begin = 0;
  for (const uint64_t offset : offsets) {
    if (offset - begin < least && offset != end) continue;
    ends.push_back(begin = offset);
  }
  return ends;
}

}  // namespace

absl::StatusOr<PageParts> SplitPageFile(const std::string& file_name, const std::string& page_path,
                                        const std::string& folder, const VolumeLimits& limits) {
  auto file = volume::FileBytes::Open(file_name, page_path);
  if (!file.ok()) return file.status();
  auto again = volume::FileBytes::Open(file_name, page_path);
  if (!again.ok()) return again.status();
  const auto pages =
      volume::PageFile::Open(file_name, *std::move(again), volume::FileKind::kPages, limits);
  if (!pages.ok()) return pages.status();
  const std::vector<uint64_t> ends = PartEnds(pages->PageOffsets());
  volume::PageTrailer trailer;
  if (!file->Read(file->size() - sizeof(trailer), sizeof(trailer), &trailer) ||
      ends.back() > trailer.index_offset_bytes) {
    return absl::InvalidArgumentError(absl::StrCat(file_name, ": its pages lie outside"));
  }
  const absl::StatusOr<std::unique_ptr<FileSystemSync>> sync = FileSystemSync::Open(folder);
  if (!sync.ok()) return sync.status();
  PageParts parts;
  std::string index;
  const auto append = [&index](uint64_t number) {
    index.append(reinterpret_cast<const char*>(&number), sizeof(number));
  };
  append(volume::kPartsMagic);
  append(ends.size());
  uint64_t begin = 0;
  for (const uint64_t end : ends) {
    append(end - begin);
    const absl::StatusOr<std::string> bytes = Bytes(file_name, *file, begin, end);
    if (!bytes.ok()) return bytes.status();
    parts.part_paths.push_back(PagePartPath(folder, parts.part_paths.size()));
    absl::Status status = WriteFileUnsynced(parts.part_paths.back(), *bytes);
    if (!status.ok()) return status;
    begin = end;
  }
  const uint64_t index_at = trailer.index_offset_bytes;
  const absl::StatusOr<std::string> bytes =
      Bytes(file_name, *file, index_at, index_at + trailer.index_bytes);
  if (!bytes.ok()) return bytes.status();
  trailer.index_offset_bytes = index.size();
  index += *bytes;
  index.append(reinterpret_cast<const char*>(&trailer), sizeof(trailer));
  parts.index_path = folder + "/index";
  absl::Status status = WriteFileUnsynced(parts.index_path, index);
  if (status.ok()) status = (*sync)->Sync();
  if (!status.ok()) return status;
  return parts;
}

std::optional<size_t> PagePartCount(const std::string& index_path) {
  const auto file = volume::FileBytes::Open(index_path, index_path);
  std::array<uint64_t, 2> head{};
  if (!file.ok() || !file->Read(0, sizeof(head), head.data()) || head[0] != volume::kPartsMagic ||
      head[1] > volume::kPagePartsMax) {
    return std::nullopt;
  }
  return head[1];
}

std::optional<uint64_t> PageIndexBytes(const std::string& local_path) {
  const auto file = volume::FileBytes::Open(local_path, local_path);
  volume::PageTrailer trailer;
  if (!file.ok() || file->size() < sizeof(trailer) ||
      !file->Read(file->size() - sizeof(trailer), sizeof(trailer), &trailer) ||
      trailer.magic != volume::kPageMagic || trailer.index_bytes > file->size()) {
    return std::nullopt;
  }
  return trailer.index_bytes;
}

}  // namespace sheaf
