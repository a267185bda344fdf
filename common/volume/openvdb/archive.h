// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Archive: the grids of an open .vdb file.
#pragma once

#include <array>
#include <cstdint>
#include <ios>
#include <istream>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/volume/file_buffer.h"
#include "common/volume/openvdb/headers.h"
#include "common/volume/volume_grid.h"

namespace sheaf::volume {

inline absl::Status CutShort(const std::string& where) {
  return absl::DataLossError(absl::StrCat(where, ": the file is cut short or damaged"));
}

// The grids of a file. OpenVDB's own File opens paths, which a confined process may not.
class Archive : private vdb::io::Archive {
 public:
  explicit Archive(int file) : buffer_(file), in_(&buffer_) {
    // OpenVDB does not look: it would continue with whatever its variables hold.
    in_.exceptions(std::ios_base::badbit | std::ios_base::failbit | std::ios_base::eofbit);
  }

  // Reads what the file says of its grids and, where they follow each other without offsets, the
  // grids.
  absl::Status Open(const std::string& where, const VolumeLimits& limits) {
    readHeader(in_);
    vdb::io::setStreamMetadataPtr(in_, stream_state_, /*transfer=*/false);
    vdb::io::setVersion(in_, libraryVersion(), fileVersion());
    vdb::io::setDataCompression(in_, compression());
    vdb::MetaMap().readMeta(in_);
    const int32_t count = readGridCount(in_);
    if (count < 0) return CutShort(where);
    if (count > limits.grid_count_max) {
      return absl::ResourceExhaustedError(absl::StrCat(where, ": ", count, " grids, more than ",
                                                       limits.grid_count_max, " (grid_count_max)"));
    }
    for (int32_t i = 0; i < count; ++i) {
      Stored stored;
      ReadDescriptor(&stored);
      const bool is_last = i + 1 == count;
      if (!inputHasGridOffsets()) {
        if (!stored.is_known && !is_last) return Skipped(where, stored.descriptor.gridType());
        if (stored.is_known) stored.grid = ReadHere(stored.descriptor);
      } else if (!is_last) {
        stored.descriptor.seekToEnd(in_);
      }
      stored_.push_back(std::move(stored));
    }
    return absl::OkStatus();
  }

  size_t size() const { return stored_.size(); }
  const vdb::io::GridDescriptor& Descriptor(size_t i) const { return stored_[i].descriptor; }

  // With the tree of another grid if it is an instance.
  absl::StatusOr<vdb::GridBase::Ptr> Read(const std::string& where, size_t i) {
    const vdb::io::GridDescriptor& descriptor = Descriptor(i);
    const vdb::GridBase::Ptr grid = ReadAlone(i);
    if (!descriptor.isInstance()) return grid;
    for (size_t k = 0; k < stored_.size(); ++k) {
      if (Descriptor(k).uniqueName() != descriptor.instanceParentName()) continue;
      if (Descriptor(k).isInstance() || Descriptor(k).gridType() != descriptor.gridType()) break;
      grid->setTree(ReadAlone(k)->baseTreePtr());
      return grid;
    }
    return absl::DataLossError(
        absl::StrCat(where, ": grid \"", descriptor.gridName(), "\" shares the tree of \"",
                     vdb::io::GridDescriptor::nameAsString(descriptor.instanceParentName()),
                     "\", which the file does not have; write it again"));
  }

 private:
  struct Stored {
    vdb::io::GridDescriptor descriptor;
    bool is_known = true;
    vdb::GridBase::Ptr grid;  // Only without offsets.
  };

  static absl::Status Skipped(const std::string& where, const std::string& type) {
    return absl::InvalidArgumentError(absl::StrCat(
        where, ": a grid of type ", type, ", which OpenVDB does not know, is followed ",
        "by others without offsets (a stream); write it as a file"));
  }

  void ReadDescriptor(Stored* stored) {
    try {
      stored->descriptor.read(in_);
    } catch (const vdb::LookupError&) {
      stored->is_known = false;  // The offsets of the grid come next.
      std::array<int64_t, 3> offsets{};
      in_.read(reinterpret_cast<char*>(offsets.data()), sizeof(offsets));
      stored->descriptor.setGridPos(offsets[0]);
      stored->descriptor.setBlockPos(offsets[1]);
      stored->descriptor.setEndPos(offsets[2]);
    }
  }
  vdb::GridBase::Ptr ReadHere(const vdb::io::GridDescriptor& descriptor) {
    const vdb::GridBase::Ptr grid = vdb::GridBase::createGrid(descriptor.gridType());
    grid->setSaveFloatAsHalf(descriptor.saveFloatAsHalf());
    readGrid(grid, descriptor, in_);
    return grid;
  }
  vdb::GridBase::Ptr ReadAlone(size_t i) {
    if (!inputHasGridOffsets()) return stored_[i].grid;
    Descriptor(i).seekToGrid(in_);
    return ReadHere(Descriptor(i));
  }

  FileBuffer buffer_;
  std::istream in_;
  vdb::io::StreamMetadata::Ptr stream_state_ = std::make_shared<vdb::io::StreamMetadata>();
  std::vector<Stored> stored_;
};

// The file's name of the grid's type, with the suffix of files that hold halves.
inline std::string TypeName(const vdb::io::GridDescriptor& descriptor) {
  return absl::StrCat(descriptor.gridType(), descriptor.saveFloatAsHalf() ? "_HalfFloat" : "");
}

inline bool IsScalar(const std::string& type) {
  return type == vdb::FloatGrid::gridType() || type == vdb::DoubleGrid::gridType() ||
         type == vdb::Int32Grid::gridType() || type == vdb::Int64Grid::gridType() ||
         type == vdb::BoolGrid::gridType() || type == vdb::MaskGrid::gridType();
}
inline bool IsVector(const std::string& type) {
  return type == vdb::Vec3SGrid::gridType() || type == vdb::Vec3DGrid::gridType() ||
         type == vdb::Vec3IGrid::gridType();
}

template <typename GridT, typename FromT>
typename GridT::Ptr Converted(const FromT& from) {
  auto grid = GridT::create(
      typename GridT::TreeType::Ptr(std::make_shared<typename GridT::TreeType>(from.constTree())));
  grid->setTransform(from.transform().copy());
  grid->setGridClass(from.getGridClass());
  return grid;
}

// A mask has no values: it is 1 where it is active.
inline vdb::FloatGrid::Ptr OnesOf(const vdb::MaskGrid& mask) {
  auto grid = vdb::FloatGrid::create(
      std::make_shared<vdb::FloatTree>(mask.constTree(), 0.0f, 1.0f, vdb::TopologyCopy()));
  grid->setTransform(mask.transform().copy());
  return grid;
}

inline vdb::FloatGrid::Ptr Scalars(const vdb::GridBase::Ptr& grid) {
  if (auto floats = vdb::gridPtrCast<vdb::FloatGrid>(grid)) return floats;
  if (auto doubles = vdb::gridPtrCast<vdb::DoubleGrid>(grid)) {
    return Converted<vdb::FloatGrid>(*doubles);
  }
  if (auto numbers = vdb::gridPtrCast<vdb::Int32Grid>(grid)) {
    return Converted<vdb::FloatGrid>(*numbers);
  }
  if (auto numbers = vdb::gridPtrCast<vdb::Int64Grid>(grid)) {
    return Converted<vdb::FloatGrid>(*numbers);
  }
  if (auto flags = vdb::gridPtrCast<vdb::BoolGrid>(grid)) {
    return Converted<vdb::FloatGrid>(*flags);
  }
  return OnesOf(*vdb::gridPtrCast<vdb::MaskGrid>(grid));
}

inline absl::Status NotReadable(const std::string& where,
                                const vdb::io::GridDescriptor& descriptor) {
  const std::string& type = descriptor.gridType();
  const bool has_points =
      absl::StartsWith(type, "Tree_ptdataidx") || absl::StartsWith(type, "Tree_ptidx");
  return absl::InvalidArgumentError(
      absl::StrCat(where, ": grid \"", descriptor.gridName(), "\" is a ", TypeName(descriptor),
                   has_points ? ", which holds points, no values" : ", which OpenVDB does not know",
                   "; grids of numbers and of vectors can be read: convert it"));
}

}  // namespace sheaf::volume
