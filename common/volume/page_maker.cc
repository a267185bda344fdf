// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/page_maker.h"

#include <array>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/volume/file_bytes.h"
#include "common/volume/grid_pager.h"
#include "common/volume/image_source.h"
#include "common/volume/nanovdb_verify.h"
#include "common/volume/nvdb_file.h"
#include "common/volume/page_writer.h"
#include "common/volume/vdb_file.h"
#include "common/volume/volume_file.h"

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
    indices_.push_back(*std::move(index));
    summary_.grids.push_back(entry.name);
    summary_.image_bytes += image.size();
    return absl::OkStatus();
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
  if (*kind == volume::FileKind::kPages) {
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
