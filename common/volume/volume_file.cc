// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/volume_file.h"

#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/volume/nvdb_file.h"
#include "common/volume/page_file.h"
#include "common/volume/vdb_file.h"
#include "common/volume/volume_surface.h"

namespace sheaf {

namespace volume {

// A file that is open.
class OpenVolume {
 public:
  static absl::StatusOr<std::unique_ptr<OpenVolume>> Open(const std::string& file_name,
                                                          const std::string& local_path,
                                                          const VolumeLimits& limits,
                                                          PartedBytes::OpenPart open_part);
  virtual ~OpenVolume() = default;

  virtual std::vector<VolumeFileEntry> List() const = 0;
  // Requires: a grid of a page file is read once.
  virtual absl::StatusOr<VolumeGrid> Read(const std::string& grid_name, int thread_count,
                                          std::shared_ptr<VolumePages> pages) = 0;
};

}  // namespace volume

namespace {

using volume::OpenVolume;

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

class OpenVdb : public OpenVolume {
 public:
  static absl::StatusOr<std::unique_ptr<OpenVolume>> Make(const std::string& file_name,
                                                          OpenFile open,
                                                          const VolumeLimits& limits) {
    std::unique_ptr<OpenVdb> made(new OpenVdb(file_name, std::move(open), limits));
    auto file = volume::VdbFile::Open(file_name, made->open_.file, limits);
    if (!file.ok()) return file.status();
    auto entries = ListVdb(**file);
    if (!entries.ok()) return entries.status();
    made->file_ = *std::move(file);
    made->entries_ = *std::move(entries);
    return made;
  }
  std::vector<VolumeFileEntry> List() const override { return entries_; }
  absl::StatusOr<VolumeGrid> Read(const std::string& grid_name, int thread_count,
                                  std::shared_ptr<volume::VolumePages> /*pages*/) override {
    const auto index = Find(file_name_, entries_, grid_name);
    if (!index.ok()) return index.status();
    auto image = file_->Read(*index);
    if (!image.ok()) return image.status();
    return VolumeGrid::FromImage(*std::move(image), file_name_, limits_, thread_count);
  }

 private:
  OpenVdb(const std::string& file_name, OpenFile open, const VolumeLimits& limits)
      : file_name_(file_name), limits_(limits), open_(std::move(open)) {}

  const std::string file_name_;
  const VolumeLimits limits_;
  const OpenFile open_;
  std::unique_ptr<volume::VdbFile> file_;
  std::vector<VolumeFileEntry> entries_;
};

class OpenNvdb : public OpenVolume {
 public:
  static absl::StatusOr<std::unique_ptr<OpenVolume>> Make(const std::string& file_name,
                                                          OpenFile open,
                                                          const VolumeLimits& limits) {
    auto entries = volume::ListNvdb(file_name, open.file, limits);
    if (!entries.ok()) return entries.status();
    return std::unique_ptr<OpenVolume>(
        new OpenNvdb(file_name, std::move(open), limits, *std::move(entries)));
  }
  std::vector<VolumeFileEntry> List() const override { return {entries_.begin(), entries_.end()}; }
  absl::StatusOr<VolumeGrid> Read(const std::string& grid_name, int thread_count,
                                  std::shared_ptr<volume::VolumePages> /*pages*/) override {
    const auto index = Find(file_name_, entries_, grid_name);
    if (!index.ok()) return index.status();
    return volume::ReadNvdbGrid(file_name_, open_.file, entries_[*index], limits_, thread_count);
  }

 private:
  OpenNvdb(const std::string& file_name, OpenFile open, const VolumeLimits& limits,
           std::vector<volume::NvdbEntry> entries)
      : file_name_(file_name),
        limits_(limits),
        open_(std::move(open)),
        entries_(std::move(entries)) {}

  const std::string file_name_;
  const VolumeLimits limits_;
  const OpenFile open_;
  const std::vector<volume::NvdbEntry> entries_;
};

class OpenPages : public OpenVolume {
 public:
  OpenPages(const std::string& file_name, const VolumeLimits& limits, volume::PageFile file)
      : file_name_(file_name), limits_(limits), entries_(file.List()), file_(std::move(file)) {}
  std::vector<VolumeFileEntry> List() const override { return entries_; }
  absl::StatusOr<VolumeGrid> Read(const std::string& grid_name, int /*thread_count*/,
                                  std::shared_ptr<volume::VolumePages> pages) override {
    const auto index = Find(file_name_, entries_, grid_name);
    if (!index.ok()) return index.status();
    if (pages == nullptr) {
      pages = std::make_shared<volume::VolumePages>(volume::VolumePages::kBytesMaxDefault);
    }
    return file_.Take(*index, limits_, std::move(pages));
  }

 private:
  const std::string file_name_;
  const VolumeLimits limits_;
  const std::vector<VolumeFileEntry> entries_;
  volume::PageFile file_;
};

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

absl::StatusOr<std::unique_ptr<volume::OpenVolume>> volume::OpenVolume::Open(
    const std::string& file_name, const std::string& local_path, const VolumeLimits& limits,
    volume::PartedBytes::OpenPart open_part) {
  auto open = sheaf::Open(file_name, local_path);
  if (!open.ok()) return open.status();
  switch (open->kind) {
    case volume::FileKind::kVdb:
      return OpenVdb::Make(file_name, *std::move(open), limits);
    case volume::FileKind::kNvdb:
      return OpenNvdb::Make(file_name, *std::move(open), limits);
    case volume::FileKind::kPages:
    case volume::FileKind::kPageParts:
      break;
  }
  auto file = volume::PageFile::Open(file_name, std::move(open->file), open->kind, limits,
                                     std::move(open_part));
  if (!file.ok()) return file.status();
  return std::make_unique<OpenPages>(file_name, limits, *std::move(file));
}

absl::StatusOr<std::vector<VolumeFileEntry>> ListVolumeFile(const std::string& file_name,
                                                            const std::string& local_path,
                                                            const VolumeLimits& limits) {
  const auto file = OpenVolume::Open(file_name, local_path, limits, nullptr);
  if (!file.ok()) return file.status();
  return (*file)->List();
}

absl::StatusOr<VolumeGrid> ReadVolumeGrid(const std::string& file_name,
                                          const std::string& local_path,
                                          const std::string& grid_name, const VolumeLimits& limits,
                                          int thread_count,
                                          std::shared_ptr<volume::VolumePages> pages,
                                          volume::PartedBytes::OpenPart open_part) {
  const auto file = OpenVolume::Open(file_name, local_path, limits, std::move(open_part));
  if (!file.ok()) return file.status();
  return (*file)->Read(grid_name, thread_count, std::move(pages));
}

VolumeReader::VolumeReader() = default;
VolumeReader::~VolumeReader() = default;

VolumeReader::Opened VolumeReader::Open(const std::string& file_name,
                                        const std::string& local_path) {
  const auto known = files_.find(local_path);
  if (known != files_.end()) return known->second;
  ++open_count_;
  Opened opened = volume::OpenVolume::Open(file_name, local_path, {}, nullptr);
  if (files_.size() < kKeptVolumesMax) files_.emplace(local_path, opened);
  return opened;
}

absl::StatusOr<std::vector<VolumeFileEntry>> VolumeReader::List(const std::string& file_name,
                                                                const std::string& local_path) {
  const Opened file = Open(file_name, local_path);
  if (!file.ok()) return file.status();
  return (*file)->List();
}

absl::StatusOr<VolumeGrid> VolumeReader::Read(const std::string& file_name,
                                              const std::string& local_path,
                                              const std::string& grid_name) {
  const std::pair key{local_path, grid_name};
  const auto known = grids_.find(key);
  if (known != grids_.end()) return known->second;
  const Opened file = Open(file_name, local_path);
  if (!file.ok()) return file.status();
  auto grid = (*file)->Read(grid_name, 1, nullptr);
  // A page file gives a grid once, and no more than its index, which it has in memory.
  if (!grid.ok() || grid->is_paged() || grid->memory_bytes() <= kKeptGridBytesMax) {
    grids_.emplace(key, grid);
  }
  return grid;
}

}  // namespace sheaf
