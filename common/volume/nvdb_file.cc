// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/nvdb_file.h"

#include <algorithm>
#include <memory>

#include "absl/strings/str_cat.h"
#include "common/volume/codecs.h"
#include "common/volume/grid_names.h"
#include "common/volume/nanovdb_door.h"

namespace sheaf::volume {
namespace {

constexpr uint32_t kNameBytesMax = 4096;
// Blosc compresses at most this much at a time.
constexpr uint64_t kBloscChunkBytes = uint64_t{1} << 30;
// Maximum expansion of all codecs: zlib reaches 1032, Blosc (lz4) 255.
constexpr uint64_t kExpansionMax = 1040;

enum Codec : uint16_t { kNone = 0, kZip = 1, kBlosc = 2 };

// The layout in files, byte for byte.
struct FileHead {
  uint64_t magic;
  uint32_t version;
  uint16_t grid_count;
  uint16_t codec;
};
static_assert(sizeof(FileHead) == 16);
struct FileEntry {
  uint64_t grid_bytes, file_bytes, name_key, voxel_count;
  uint32_t grid_type, grid_class;
  double world_box[6];
  int32_t index_box[6];
  double voxel_size[3];
  uint32_t name_bytes;
  uint32_t node_count[4], tile_count[3];
  uint16_t codec, padding;
  uint32_t version;
};
static_assert(sizeof(FileEntry) == 176);

absl::Status CutShort(const std::string& file_name) {
  return absl::DataLossError(absl::StrCat(file_name, ": the file is cut short or damaged"));
}

bool IsReadable(uint32_t type) {
  using nanovdb::GridType;
  for (const GridType known : {GridType::Float, GridType::Fp4, GridType::Fp8, GridType::Fp16,
                               GridType::FpN, GridType::Vec3f}) {
    if (static_cast<uint32_t>(known) == type) return true;
  }
  return false;
}

absl::Status CheckHead(const std::string& file_name, const FileHead& head) {
  const uint32_t major = head.version >> 21;
  if (head.magic != NANOVDB_MAGIC_NUMBER) {
    return absl::InvalidArgumentError(
        absl::StrCat(file_name, ": a segment does not begin as NanoVDB"));
  }
  if (major != NANOVDB_MAJOR_VERSION_NUMBER) {
    return absl::InvalidArgumentError(absl::StrCat(
        file_name, ": NanoVDB version ", major, ", only ", NANOVDB_MAJOR_VERSION_NUMBER,
        " can be read; convert it with that version's nanovdb_convert"));
  }
  if (head.codec > kBlosc) {
    return absl::InvalidArgumentError(
        absl::StrCat(file_name, ": compression ", head.codec, " is unknown; use zip or blosc"));
  }
  return absl::OkStatus();
}

// The compressed bytes at *offset, preceded by their length.
absl::Status ReadPacked(const std::string& file_name, const FileBytes& file, uint64_t* offset,
                        std::unique_ptr<std::byte[]>* packed, uint64_t* packed_bytes) {
  if (!file.Read(*offset, sizeof(*packed_bytes), packed_bytes)) return CutShort(file_name);
  *offset += sizeof(*packed_bytes);
  if (*packed_bytes > file.size() - *offset) return CutShort(file_name);
  *packed = std::make_unique_for_overwrite<std::byte[]>(*packed_bytes);
  if (!file.Read(*offset, *packed_bytes, packed->get())) return CutShort(file_name);
  *offset += *packed_bytes;
  return absl::OkStatus();
}

absl::Status ReadData(const std::string& file_name, const FileBytes& file, const NvdbEntry& entry,
                      const VolumeBytes& image) {
  if (entry.codec == kNone) {
    return file.Read(entry.offset_bytes, image.size(), image.data()) ? absl::OkStatus()
                                                                     : CutShort(file_name);
  }
  uint64_t offset = entry.offset_bytes;
  const uint64_t chunk_max = entry.codec == kBlosc ? kBloscChunkBytes : image.size();
  for (uint64_t at = 0; at < image.size();) {
    std::unique_ptr<std::byte[]> packed;
    uint64_t packed_bytes = 0;
    const absl::Status status = ReadPacked(file_name, file, &offset, &packed, &packed_bytes);
    if (!status.ok()) return status;
    const uint64_t chunk = std::min(chunk_max, image.size() - at);
    const std::span<const std::byte> in(packed.get(), packed_bytes);
    const std::span<std::byte> out(image.data() + at, chunk);
    if (!(entry.codec == kZip ? Unzip(in, out) : UnpackBlosc(in, out))) return CutShort(file_name);
    at += chunk;
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<NvdbEntry>> ListNvdb(const std::string& file_name, const FileBytes& file,
                                                const VolumeLimits& limits) {
  std::vector<NvdbEntry> entries;
  uint64_t offset = 0;
  while (offset < file.size()) {
    FileHead head;
    if (!file.Read(offset, sizeof(head), &head)) return CutShort(file_name);
    offset += sizeof(head);
    const absl::Status status = CheckHead(file_name, head);
    if (!status.ok()) return status;
    const size_t first = entries.size();
    if (first + head.grid_count > static_cast<size_t>(limits.grid_count_max)) {
      return absl::ResourceExhaustedError(absl::StrCat(
          file_name, ": more than ", limits.grid_count_max, " grids (grid_count_max)"));
    }
    for (int i = 0; i < head.grid_count; ++i) {
      FileEntry stored;
      if (!file.Read(offset, sizeof(stored), &stored)) return CutShort(file_name);
      offset += sizeof(stored);
      if (stored.name_bytes > kNameBytesMax) return CutShort(file_name);
      NvdbEntry entry;
      entry.name.resize(stored.name_bytes);
      if (!file.Read(offset, stored.name_bytes, entry.name.data())) return CutShort(file_name);
      offset += stored.name_bytes;
      entry.name = entry.name.c_str();  // Files store the terminating zero.
      entry.role = VolumeRoleOf(entry.name);
      const auto type = static_cast<nanovdb::GridType>(stored.grid_type);
      entry.type_name = type < nanovdb::GridType::End ? nanovdb::toStr(type) : "unknown";
      entry.can_be_read = IsReadable(stored.grid_type);
      entry.grid_bytes = stored.grid_bytes;
      entry.file_bytes = stored.file_bytes;
      entry.codec = head.codec;
      entries.push_back(std::move(entry));
    }
    for (size_t i = first; i < entries.size(); ++i) {
      entries[i].offset_bytes = offset;
      if (entries[i].file_bytes > file.size() - offset) return CutShort(file_name);
      offset += entries[i].file_bytes;
    }
  }
  NumberSharedNames(&entries);
  return entries;
}

absl::StatusOr<VolumeBytes> ReadNvdbImage(const std::string& file_name, const FileBytes& file,
                                          const NvdbEntry& entry, const VolumeLimits& limits) {
  if (entry.grid_bytes > limits.grid_bytes_max) {
    return absl::ResourceExhaustedError(
        absl::StrCat(file_name, ": grid \"", entry.name, "\" takes ", entry.grid_bytes,
                     " bytes, more than ", limits.grid_bytes_max, " (grid_bytes_max)"));
  }
  if (entry.grid_bytes / kExpansionMax > entry.file_bytes ||
      (entry.codec == kNone && entry.grid_bytes > entry.file_bytes)) {
    return CutShort(file_name);
  }
  VolumeBytes image(entry.grid_bytes);
  if (image.data() == nullptr) {
    return absl::ResourceExhaustedError(absl::StrCat(file_name, ": no memory for the ",
                                                     entry.grid_bytes, " bytes of grid \"",
                                                     entry.name, "\""));
  }
  const absl::Status status = ReadData(file_name, file, entry, image);
  if (!status.ok()) return status;
  return image;
}

absl::StatusOr<VolumeGrid> ReadNvdbGrid(const std::string& file_name, const FileBytes& file,
                                        const NvdbEntry& entry, const VolumeLimits& limits,
                                        int thread_count) {
  auto image = ReadNvdbImage(file_name, file, entry, limits);
  if (!image.ok()) return image.status();
  return VolumeGrid::FromImage(*std::move(image), file_name, limits, thread_count);
}

}  // namespace sheaf::volume
