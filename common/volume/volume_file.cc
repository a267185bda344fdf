// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/volume_file.h"

#include <cmath>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/volume/nvdb_file.h"
#include "common/volume/page_file.h"
#include "common/volume/vdb_file.h"
#include "common/volume/volume_surface.h"

namespace sheaf {
namespace {

constexpr uint64_t kNanovdbMagic = 0x304244566f6e614e;  // "NanoVDB0".

template <typename Entry>
std::string JoinNames(const std::vector<Entry>& entries) {
  return absl::StrJoin(entries, ", ", [](std::string* out, const Entry& entry) {
    absl::StrAppend(out, "\"", entry.name, "\" (", entry.type_name, ")");
  });
}

// The place of the grid of that name.
template <typename Entry>
absl::StatusOr<size_t> Find(const std::string& file_name, const std::vector<Entry>& entries,
                            const std::string& grid_name) {
  for (size_t i = 0; i < entries.size(); ++i) {
    if (entries[i].name == grid_name) return i;
  }
  return absl::NotFoundError(
      absl::StrCat(file_name, ": no grid \"", grid_name, "\"; there are: ", JoinNames(entries)));
}

struct OpenFile {
  volume::FileBytes file;
  volume::FileKind kind;
};
absl::StatusOr<OpenFile> Open(const std::string& file_name, const std::string& local_path) {
  auto file = volume::FileBytes::Open(file_name, local_path);
  if (!file.ok()) return file.status();
  const auto kind = volume::KindOf(file_name, *file);
  if (!kind.ok()) return kind.status();
  return OpenFile{*std::move(file), *kind};
}

absl::StatusOr<std::vector<VolumeFileEntry>> ListVdb(volume::VdbFile& file) {
  auto entries = file.List();
  if (!entries.ok()) return entries;
  for (VolumeFileEntry& entry : *entries) entry.role = VolumeRoleOf(entry.name);
  return entries;
}

absl::StatusOr<VolumeGrid> ReadVdbGrid(const std::string& file_name, const OpenFile& open,
                                       const std::string& grid_name, const VolumeLimits& limits,
                                       int thread_count) {
  const auto file = volume::VdbFile::Open(file_name, open.file, limits);
  if (!file.ok()) return file.status();
  const auto entries = ListVdb(**file);
  if (!entries.ok()) return entries.status();
  const auto index = Find(file_name, *entries, grid_name);
  if (!index.ok()) return index.status();
  auto image = (*file)->Read(*index);
  if (!image.ok()) return image.status();
  return VolumeGrid::FromImage(*std::move(image), file_name, limits, thread_count);
}

bool HasPages(volume::FileKind kind) {
  return kind == volume::FileKind::kPages || kind == volume::FileKind::kPageParts;
}

absl::StatusOr<VolumeGrid> ReadPagedGrid(const std::string& file_name, OpenFile open,
                                         const std::string& grid_name, const VolumeLimits& limits,
                                         std::shared_ptr<volume::VolumePages> pages,
                                         volume::PartedBytes::OpenPart open_part) {
  auto page_file = volume::PageFile::Open(file_name, std::move(open.file), open.kind, limits,
                                          std::move(open_part));
  if (!page_file.ok()) return page_file.status();
  const auto index = Find(file_name, page_file->List(), grid_name);
  if (!index.ok()) return index.status();
  if (pages == nullptr) {
    pages = std::make_shared<volume::VolumePages>(volume::VolumePages::kBytesMaxDefault);
  }
  return page_file->Take(*index, limits, std::move(pages));
}

// A surface that OpenVDB makes of an untrusted file is as untrusted.
absl::Status CheckSurface(const std::string& file_name, const VolumeSurface& surface) {
  const auto is_finite = [](const auto& v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z);
  };
  bool is_good =
      surface.normals.size() == surface.positions.size() && surface.triangles.size() % 3 == 0;
  for (const uint32_t at : surface.triangles) is_good = is_good && at < surface.positions.size();
  for (const Vec3d& p : surface.positions) is_good = is_good && is_finite(ToFloat(p));
  for (const Vec3f& n : surface.normals) is_good = is_good && is_finite(n);
  if (is_good) return absl::OkStatus();
  return absl::DataLossError(absl::StrCat(
      file_name, ": its surface is malformed or not finite: the file is damaged; write it again"));
}

}  // namespace

absl::StatusOr<volume::FileKind> volume::KindOf(const std::string& file_name,
                                                const FileBytes& file) {
  uint64_t magic = 0;
  if (file.Read(0, sizeof(magic), &magic)) {
    if (BeginsAsVdb(magic)) return FileKind::kVdb;
    if (magic == kNanovdbMagic) return FileKind::kNvdb;
    if (magic == kPageMagic) return FileKind::kPages;
    if (magic == kPartsMagic) return FileKind::kPageParts;
  }
  return absl::InvalidArgumentError(
      absl::StrCat(file_name, ": neither a NanoVDB (.nvdb) nor an OpenVDB (.vdb) file nor a page ",
                   "file: its first bytes match none"));
}

absl::StatusOr<VolumeSurface> ReadVolumeSurface(const std::string& file_name,
                                                const std::string& local_path,
                                                const std::string& grid_name, float isovalue,
                                                const VolumeLimits& limits) {
  const auto open = Open(file_name, local_path);
  if (!open.ok()) return open.status();
  if (open->kind != volume::FileKind::kVdb) {
    return absl::InvalidArgumentError(absl::StrCat(
        file_name, ": is a ", open->kind == volume::FileKind::kNvdb ? "NanoVDB" : "page",
        " file; surfaces are made of OpenVDB files (.vdb): convert it"));
  }
  const auto file = volume::VdbFile::Open(file_name, open->file, limits);
  if (!file.ok()) return file.status();
  const auto entries = ListVdb(**file);
  if (!entries.ok()) return entries.status();
  const bool is_only = grid_name.empty() && entries->size() == 1;
  const absl::StatusOr<size_t> index = is_only ? 0 : Find(file_name, *entries, grid_name);
  if (!index.ok() && grid_name.empty()) {
    return absl::NotFoundError(absl::StrCat(file_name, ": has ", entries->size(),
                                            " grids, none without a name; name the one that is ",
                                            "meant (gridname): ", JoinNames(*entries)));
  }
  if (!index.ok()) return index.status();
  auto surface = (*file)->Surface(*index, isovalue);
  if (!surface.ok()) return surface.status();
  if (absl::Status status = CheckSurface(file_name, *surface); !status.ok()) return status;
  return surface;
}

absl::StatusOr<std::vector<VolumeFileEntry>> ListVolumeFile(const std::string& file_name,
                                                            const std::string& local_path,
                                                            const VolumeLimits& limits) {
  auto open = Open(file_name, local_path);
  if (!open.ok()) return open.status();
  if (HasPages(open->kind)) {
    const auto file = volume::PageFile::Open(file_name, std::move(open->file), open->kind, limits);
    if (!file.ok()) return file.status();
    return file->List();
  }
  if (open->kind == volume::FileKind::kVdb) {
    const auto file = volume::VdbFile::Open(file_name, open->file, limits);
    return file.ok() ? ListVdb(**file) : file.status();
  }
  const auto entries = volume::ListNvdb(file_name, open->file, limits);
  if (!entries.ok()) return entries.status();
  return std::vector<VolumeFileEntry>(entries->begin(), entries->end());
}

absl::StatusOr<VolumeGrid> ReadVolumeGrid(const std::string& file_name,
                                          const std::string& local_path,
                                          const std::string& grid_name, const VolumeLimits& limits,
                                          int thread_count,
                                          std::shared_ptr<volume::VolumePages> pages,
                                          volume::PartedBytes::OpenPart open_part) {
  auto open = Open(file_name, local_path);
  if (!open.ok()) return open.status();
  if (HasPages(open->kind)) {
    return ReadPagedGrid(file_name, *std::move(open), grid_name, limits, std::move(pages),
                         std::move(open_part));
  }
  if (open->kind == volume::FileKind::kVdb)
    return ReadVdbGrid(file_name, *open, grid_name, limits, thread_count);
  const auto entries = volume::ListNvdb(file_name, open->file, limits);
  if (!entries.ok()) return entries.status();
  const auto index = Find(file_name, *entries, grid_name);
  if (!index.ok()) return index.status();
  return volume::ReadNvdbGrid(file_name, open->file, (*entries)[*index], limits, thread_count);
}

}  // namespace sheaf
