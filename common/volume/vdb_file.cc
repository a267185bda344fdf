// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/vdb_file.h"

#include <bit>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/strip.h"
#include "common/volume/vdb_tree.h"

namespace sheaf::volume {
namespace {

constexpr int64_t kMagic = 0x56444220;
constexpr uint32_t kVersionMin = 222, kVersionMax = 224;
constexpr uint64_t kUuidBytes = 36;

absl::Status VdbCutShort(const std::string& file_name) {
  return absl::DataLossError(absl::StrCat(file_name, ": the file is cut short or damaged"));
}

std::span<const std::byte> AsBytes(const std::string& bytes) {
  return std::as_bytes(std::span(bytes.data(), bytes.size()));
}

// A stored matrix multiplies row vectors from the right.
Matrix4 ReadRowMatrix(VdbStream* in) {
  Matrix4 m;
  for (size_t row = 0; row < 4; ++row) {
    for (size_t column = 0; column < 4; ++column) m.m[column][row] = in->Get<double>();
  }
  return m;
}
Vec3d ReadVector(VdbStream* in) {
  const auto x = in->Get<double>(), y = in->Get<double>(), z = in->Get<double>();
  return {x, y, z};
}

// medium_from_index. Errors: kInvalidArgument if it is not affine.
absl::StatusOr<Matrix4> ReadTransform(const std::string& where, const std::string& grid,
                                      VdbStream* in) {
  // The scales are followed by their inverse, its square and half, and the voxel size.
  constexpr int kDerivedVectors = 4;
  const std::string type = in->GetString();
  Matrix4 m;
  if (type == "AffineMap" || type == "UnitaryMap") {
    m = ReadRowMatrix(in);
    if (m.m[3] != std::array<double, 4>{0, 0, 0, 1}) in->Fail();
  } else if (type == "TranslationMap") {
    m = TranslateMatrix(ReadVector(in));
  } else if (absl::EndsWith(type, "ScaleMap") || absl::EndsWith(type, "ScaleTranslateMap")) {
    const Vec3d offset =
        absl::EndsWith(type, "ScaleTranslateMap") ? ReadVector(in) : Vec3d{0, 0, 0};
    m = TranslateMatrix(offset) * ScaleMatrix(ReadVector(in));
    for (int i = 0; i < kDerivedVectors; ++i) ReadVector(in);
  } else if (in->ok()) {
    return absl::InvalidArgumentError(
        absl::StrCat(where, ": grid \"", grid, "\" has a transform of type ", type,
                     "; only affine ones can be read: resample it into a grid of straight axes"));
  }
  return m;
}

}  // namespace

bool BeginsAsVdb(uint64_t first_eight_bytes) {
  return static_cast<int64_t>(first_eight_bytes) == kMagic;
}

absl::StatusOr<std::vector<VdbEntry>> ListVdb(const std::string& file_name,
                                              const std::string& bytes,
                                              const VolumeLimits& limits) {
  VdbStream in(AsBytes(bytes), 0);
  if (in.Get<int64_t>() != kMagic) {
    return absl::InvalidArgumentError(absl::StrCat(file_name, ": it does not begin as OpenVDB"));
  }
  const auto version = in.Get<uint32_t>();
  if (in.ok() && (version < kVersionMin || version > kVersionMax)) {
    return absl::InvalidArgumentError(absl::StrCat(
        file_name, ": version ", version, " of OpenVDB's format, versions ", kVersionMin, " to ",
        kVersionMax, " can be read; write it again with OpenVDB"));
  }
  in.Skip(2 * sizeof(uint32_t));  // The library's version.
  const bool has_offsets = in.Get<uint8_t>() != 0;
  in.Skip(kUuidBytes);
  in.SkipMetadata();
  const auto count = in.Get<int32_t>();
  if (!in.ok() || count < 0) return VdbCutShort(file_name);
  if (!has_offsets && count > 1) {
    return absl::InvalidArgumentError(
        absl::StrCat(file_name, ": several grids without offsets (a stream); write it as a file"));
  }
  if (count > limits.grid_count_max) {
    return absl::ResourceExhaustedError(absl::StrCat(file_name, ": ", count, " grids, more than ",
                                                     limits.grid_count_max, " (grid_count_max)"));
  }
  std::vector<VdbEntry> entries;
  for (int32_t i = 0; i < count; ++i) {
    VdbEntry entry;
    const std::string unique_name = in.GetString();
    // Duplicate names are distinguished by a suffix after this character.
    entry.name = unique_name.substr(0, unique_name.find('\x1e'));
    std::string type = in.GetString();
    entry.is_half = absl::EndsWith(type, "_HalfFloat");
    entry.grid_type = std::string(absl::StripSuffix(type, "_HalfFloat"));
    entry.type_name = type;
    entry.instance_of = in.GetString();
    in.Skip(2 * sizeof(int64_t));
    entry.end_bytes = in.Get<uint64_t>();
    entry.offset_bytes = in.at();
    entry.role = VolumeRoleOf(entry.name);
    entry.can_be_read = entry.instance_of.empty() && (entry.grid_type == "Tree_float_5_4_3" ||
                                                      entry.grid_type == "Tree_vec3s_5_4_3");
    if (i + 1 < count) {
      if (entry.end_bytes < in.at()) in.Fail();
      in.Skip(entry.end_bytes - in.at());
    }
    if (!in.ok()) return VdbCutShort(file_name);
    entries.push_back(std::move(entry));
  }
  return entries;
}

absl::StatusOr<VolumeGrid> ReadVdbGrid(const std::string& file_name, const std::string& bytes,
                                       const VdbEntry& entry, const VolumeLimits& limits,
                                       int thread_count) {
  if (!entry.can_be_read) {
    return absl::InvalidArgumentError(
        absl::StrCat(file_name, ": grid \"", entry.name, "\" ",
                     entry.instance_of.empty()
                         ? absl::StrCat("is a ", entry.type_name,
                                        "; trees of float and of vec3s can be read: convert it")
                         : absl::StrCat("shares the tree of \"", entry.instance_of,
                                        "\"; write it as a grid of its own")));
  }
  VdbStream in(AsBytes(bytes), entry.offset_bytes);
  const auto compression = in.Get<uint32_t>();
  in.SkipMetadata();
  const auto medium_from_index = ReadTransform(file_name, entry.name, &in);
  if (!medium_from_index.ok()) return medium_from_index.status();
  if (!in.ok()) return VdbCutShort(file_name);
  const VdbTreeSource source{in, compression, entry.is_half};
  auto image =
      entry.grid_type == "Tree_float_5_4_3"
          ? ReadVdbTree<float>(file_name, entry.name, *medium_from_index, source, limits)
          : ReadVdbTree<nanovdb::Vec3f>(file_name, entry.name, *medium_from_index, source, limits);
  if (!image.ok()) return image.status();
  return VolumeGrid::FromImage(*std::move(image), file_name, limits, thread_count);
}

}  // namespace sheaf::volume
