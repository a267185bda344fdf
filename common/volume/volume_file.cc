// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/volume_file.h"

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/file.h"
#include "common/volume/nvdb_file.h"
#include "common/volume/vdb_file.h"

namespace sheaf {
namespace {

constexpr uint64_t kNanovdbMagic = 0x304244566f6e614e;  // "NanoVDB0".
// Limit for files that are read whole, like .vdb files, which are compressed.
constexpr uint64_t kVdbFileBytesMax = uint64_t{16} << 30;

template <typename Entry>
absl::StatusOr<Entry> Find(const std::string& file_name, const std::vector<Entry>& entries,
                           const std::string& grid_name) {
  for (const Entry& entry : entries) {
    if (entry.name == grid_name) return entry;
  }
  return absl::NotFoundError(absl::StrCat(
      file_name, ": no grid \"", grid_name,
      "\"; there are: ", absl::StrJoin(entries, ", ", [](std::string* out, const Entry& entry) {
        absl::StrAppend(out, "\"", entry.name, "\" (", entry.type_name, ")");
      })));
}

struct OpenFile {
  volume::FileBytes file;
  bool is_vdb;
};
absl::StatusOr<OpenFile> Open(const std::string& file_name, const std::string& local_path) {
  auto file = volume::FileBytes::Open(file_name, local_path);
  if (!file.ok()) return file.status();
  uint64_t magic = 0;
  const bool has_magic = file->Read(0, sizeof(magic), &magic);
  const bool is_vdb = has_magic && volume::BeginsAsVdb(magic);
  if (!is_vdb && (!has_magic || magic != kNanovdbMagic)) {
    return absl::InvalidArgumentError(absl::StrCat(
        file_name,
        ": neither a NanoVDB (.nvdb) nor an OpenVDB (.vdb) file: its first bytes match neither"));
  }
  return OpenFile{*std::move(file), is_vdb};
}

}  // namespace

absl::StatusOr<std::vector<VolumeFileEntry>> ListVolumeFile(const std::string& file_name,
                                                            const std::string& local_path,
                                                            const VolumeLimits& limits) {
  const auto open = Open(file_name, local_path);
  if (!open.ok()) return open.status();
  if (open->is_vdb) {
    const auto bytes = ReadWholeFile(local_path, kVdbFileBytesMax);
    if (!bytes.ok()) return bytes.status();
    const auto entries = volume::ListVdb(file_name, *bytes, limits);
    if (!entries.ok()) return entries.status();
    return std::vector<VolumeFileEntry>(entries->begin(), entries->end());
  }
  const auto entries = volume::ListNvdb(file_name, open->file, limits);
  if (!entries.ok()) return entries.status();
  return std::vector<VolumeFileEntry>(entries->begin(), entries->end());
}

absl::StatusOr<VolumeGrid> ReadVolumeGrid(const std::string& file_name,
                                          const std::string& local_path,
                                          const std::string& grid_name, const VolumeLimits& limits,
                                          int thread_count) {
  const auto open = Open(file_name, local_path);
  if (!open.ok()) return open.status();
  if (open->is_vdb) {
    const auto bytes = ReadWholeFile(local_path, kVdbFileBytesMax);
    if (!bytes.ok()) return bytes.status();
    const auto entries = volume::ListVdb(file_name, *bytes, limits);
    if (!entries.ok()) return entries.status();
    const auto entry = Find(file_name, *entries, grid_name);
    if (!entry.ok()) return entry.status();
    return volume::ReadVdbGrid(file_name, *bytes, *entry, limits, thread_count);
  }
  const auto entries = volume::ListNvdb(file_name, open->file, limits);
  if (!entries.ok()) return entries.status();
  const auto entry = Find(file_name, *entries, grid_name);
  if (!entry.ok()) return entry.status();
  return volume::ReadNvdbGrid(file_name, open->file, *entry, limits, thread_count);
}

}  // namespace sheaf
