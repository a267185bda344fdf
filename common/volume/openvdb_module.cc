// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// libsheaf_openvdb.so: the door to OpenVDB, in one source file, because its templates take long to
// compile. Reads grids of .vdb files, brings them into trees of float or of three floats on
// straight axes, and copies these into NanoVDB images. OpenVDB trusts its input and throws: this
// code runs in confined processes, and lets no exception out.
//
//     FileBuffer > Archive > GridBase > Scalars > FloatGrid, Vec3SGrid ... > ImageOf
#include <algorithm>
#include <array>
#include <cmath>
#include <ios>
#include <istream>
#include <limits>
#include <new>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "common/volume/file_buffer.h"
#include "common/volume/image_builder.h"
#include "common/volume/vdb_library.h"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpragmas"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wundef"
#pragma GCC diagnostic ignored "-Wpedantic"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wall"
#include <openvdb/io/Archive.h>
#include <openvdb/io/GridDescriptor.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/GridTransformer.h>
#include <openvdb/tools/Interpolation.h>
#include <openvdb/tools/LevelSetUtil.h>
#include <tbb/task_arena.h>
#pragma GCC diagnostic pop

namespace sheaf::volume {
namespace {

namespace vdb = openvdb;

// Cells of the box around a frustum that is resampled.
constexpr double kResampledCellsMax = 1 << 27;

absl::Status CutShort(const std::string& where) {
  return absl::DataLossError(absl::StrCat(where, ": the file is cut short or damaged"));
}

// The grids of a file. OpenVDB's own File opens paths, which a confined process may not.
class Archive : private vdb::io::Archive {
 public:
  explicit Archive(int file) : buffer_(file), in_(&buffer_) {
    // OpenVDB does not look: it would go on with whatever its variables hold.
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

// What a file calls the grid's type, with the suffix of files that hold halves.
std::string TypeName(const vdb::io::GridDescriptor& descriptor) {
  return absl::StrCat(descriptor.gridType(), descriptor.saveFloatAsHalf() ? "_HalfFloat" : "");
}

bool IsScalar(const std::string& type) {
  return type == vdb::FloatGrid::gridType() || type == vdb::DoubleGrid::gridType() ||
         type == vdb::Int32Grid::gridType() || type == vdb::Int64Grid::gridType() ||
         type == vdb::BoolGrid::gridType() || type == vdb::MaskGrid::gridType();
}
bool IsVector(const std::string& type) {
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
vdb::FloatGrid::Ptr OnesOf(const vdb::MaskGrid& mask) {
  auto grid = vdb::FloatGrid::create(
      std::make_shared<vdb::FloatTree>(mask.constTree(), 0.0f, 1.0f, vdb::TopologyCopy()));
  grid->setTransform(mask.transform().copy());
  return grid;
}

vdb::FloatGrid::Ptr Scalars(const vdb::GridBase::Ptr& grid) {
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

// The transform of a grid of cubes that covers the active voxels of a grid on other axes, as fine
// as its finest voxel, or as kResampledCellsMax allows. Null if there is none.
vdb::math::Transform::Ptr StraightAxes(const vdb::math::Transform& bent,
                                       const vdb::CoordBBox& voxels) {
  vdb::BBoxd box;
  double side = std::numeric_limits<double>::infinity();
  for (int corner = 0; corner < 8; ++corner) {
    const vdb::Vec3d at((corner & 1) != 0 ? voxels.max().x() : voxels.min().x(),
                        (corner & 2) != 0 ? voxels.max().y() : voxels.min().y(),
                        (corner & 4) != 0 ? voxels.max().z() : voxels.min().z());
    box.expand(bent.indexToWorld(at));
    const vdb::Vec3d size = bent.voxelSize(at);
    for (int axis = 0; axis < 3; ++axis) side = std::min(side, size[axis]);
  }
  const vdb::Vec3d extents = box.extents();
  if (!(side > 0) || !std::isfinite(side) || !std::isfinite(extents.lengthSqr())) return nullptr;
  const auto cells = [&](double voxel) {
    return (extents.x() / voxel + 1) * (extents.y() / voxel + 1) * (extents.z() / voxel + 1);
  };
  while (cells(side) > kResampledCellsMax) side *= 2;
  auto straight = vdb::math::Transform::createLinearTransform(side);
  straight->postTranslate(box.min());
  return straight;
}

// The grid on straight axes, interpolated if it was not. Null if its transform is unusable.
template <typename GridT>
typename GridT::Ptr OnStraightAxes(const typename GridT::Ptr& grid) {
  if (grid->transform().isLinear()) return grid;
  auto straight = GridT::create(grid->background());
  const vdb::CoordBBox voxels = grid->evalActiveVoxelBoundingBox();
  if (voxels.empty()) return straight;
  const auto transform = StraightAxes(grid->transform(), voxels);
  if (transform == nullptr) return nullptr;
  straight->setTransform(transform);
  vdb::tools::resampleToMatch<vdb::tools::BoxSampler>(*grid, *straight);
  return straight;
}

// medium_from_index. OpenVDB's matrices multiply row vectors from the right.
Matrix4 MatrixOf(const vdb::math::Transform& transform) {
  const vdb::Mat4d from = transform.baseMap()->getAffineMap()->getMat4();
  Matrix4 m;
  for (size_t row = 0; row < 4; ++row) {
    for (size_t column = 0; column < 4; ++column) {
      m.m[column][row] = from(static_cast<int>(row), static_cast<int>(column));
    }
  }
  return m;
}

// Copies a tree into a NanoVDB image: both have the same shape (32^3, 16^3, 8^3) and the same order
// within a node.
template <typename TreeT>
class ImageFiller {
  using ValueT = typename TreeT::ValueType;
  using BuildT = std::conditional_t<std::is_same_v<ValueT, float>, float, nanovdb::Vec3f>;
  using Builder = ImageBuilder<BuildT>;

 public:
  static absl::StatusOr<VolumeBytes> Image(const std::string& where, const std::string& name,
                                           const Matrix4& medium_from_index, const TreeT& tree,
                                           const VolumeLimits& limits) {
    const auto nodes = tree.nodeCount();
    const NodeCounts counts{tree.root().getTableSize(), nodes[2], nodes[1], nodes[0]};
    auto builder =
        Builder::Make(where, name, medium_from_index, counts, Of(tree.background()), limits);
    if (!builder.ok()) return builder.status();
    for (auto it = tree.root().cbeginValueAll(); it; ++it) {
      if (!IsAligned(it.getCoord())) return CutShort(where);
      builder->AddRootTile(Of(it.getCoord()), Of(*it), it.isValueOn());
    }
    for (auto it = tree.root().cbeginChildOn(); it; ++it) {
      if (!IsAligned(it.getCoord())) return CutShort(where);
      FillUpper(*it, builder->AddUpper(Of(it.getCoord())), &*builder);
    }
    return (*std::move(builder)).TakeImage();
  }

 private:
  // Origins are as the file has them.
  static bool IsAligned(const vdb::Coord& c) {
    return ((c.x() | c.y() | c.z()) & (TreeT::RootNodeType::ChildNodeType::DIM - 1)) == 0;
  }
  static float Of(float v) { return v; }
  template <typename NumberT>
  static nanovdb::Vec3f Of(const vdb::math::Vec3<NumberT>& v) {
    return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
  }
  static Index3 Of(const vdb::Coord& c) { return {c.x(), c.y(), c.z()}; }

  template <typename MaskT, typename ToMaskT>
  static void CopyMask(const MaskT& mask, ToMaskT* to) {
    static_assert(sizeof(*to) == MaskT::WORD_COUNT * sizeof(uint64_t));
    for (vdb::Index i = 0; i < MaskT::WORD_COUNT; ++i) {
      Builder::Words(to)[i] = mask.template getWord<vdb::Index64>(i);
    }
  }
  template <typename FromT, typename ToT>
  static void FillTable(const FromT& from, ToT* to) {
    for (auto it = from.cbeginValueAll(); it; ++it) to->data()->mTable[it.pos()].value = Of(*it);
    CopyMask(from.getValueMask(), &to->data()->mValueMask);
  }
  template <typename FromT>
  static void FillUpper(const FromT& from, typename Builder::Upper* to, Builder* builder) {
    FillTable(from, to);
    for (auto it = from.cbeginChildOn(); it; ++it) {
      FillLower(*it, builder->AddLower(to, it.pos()), builder);
    }
  }
  template <typename FromT>
  static void FillLower(const FromT& from, typename Builder::Lower* to, Builder* builder) {
    FillTable(from, to);
    for (auto it = from.cbeginChildOn(); it; ++it) {
      auto* data = builder->AddLeaf(to, it.pos())->data();
      const ValueT* values = it->buffer().data();
      for (vdb::Index i = 0; i < FromT::ChildNodeType::SIZE; ++i) data->mValues[i] = Of(values[i]);
      CopyMask(it->getValueMask(), &data->mValueMask);
    }
  }
};

template <typename GridT>
absl::StatusOr<VolumeBytes> ImageOf(const std::string& where, const std::string& name,
                                    const typename GridT::Ptr& grid, const VolumeLimits& limits) {
  const auto straight = OnStraightAxes<GridT>(grid);
  if (straight == nullptr) {
    return absl::InvalidArgumentError(
        absl::StrCat(where, ": grid \"", name, "\" has a transform of type ",
                     grid->transform().mapType(), " that is singular or not finite"));
  }
  return ImageFiller<typename GridT::TreeType>::Image(where, name, MatrixOf(straight->transform()),
                                                      straight->constTree(), limits);
}

absl::StatusOr<VolumeBytes> VectorImageOf(const std::string& where, const std::string& name,
                                          const vdb::GridBase::Ptr& grid,
                                          const VolumeLimits& limits) {
  if (const auto floats = vdb::gridPtrCast<vdb::Vec3SGrid>(grid)) {
    return ImageOf<vdb::Vec3SGrid>(where, name, floats, limits);
  }
  if (const auto doubles = vdb::gridPtrCast<vdb::Vec3DGrid>(grid)) {
    return ImageOf<vdb::Vec3DGrid>(where, name, doubles, limits);
  }
  return ImageOf<vdb::Vec3IGrid>(where, name, vdb::gridPtrCast<vdb::Vec3IGrid>(grid), limits);
}

absl::Status NotReadable(const std::string& where, const vdb::io::GridDescriptor& descriptor) {
  const std::string& type = descriptor.gridType();
  const bool has_points =
      absl::StartsWith(type, "Tree_ptdataidx") || absl::StartsWith(type, "Tree_ptidx");
  return absl::InvalidArgumentError(
      absl::StrCat(where, ": grid \"", descriptor.gridName(), "\" is a ", TypeName(descriptor),
                   has_points ? ", which holds points, no values" : ", which OpenVDB does not know",
                   "; grids of numbers and of vectors can be read: convert it"));
}

absl::StatusOr<std::vector<VolumeFileEntry>> List(const std::string& where, int file,
                                                  const VolumeLimits& limits) {
  Archive archive(file);
  if (absl::Status status = archive.Open(where, limits); !status.ok()) return status;
  std::vector<VolumeFileEntry> entries(archive.size());
  for (size_t i = 0; i < entries.size(); ++i) {
    const std::string& type = archive.Descriptor(i).gridType();
    entries[i].name = archive.Descriptor(i).gridName();
    entries[i].type_name = TypeName(archive.Descriptor(i));
    entries[i].can_be_read = IsScalar(type) || IsVector(type);
  }
  return entries;
}

absl::StatusOr<VolumeBytes> Read(const std::string& where, int file, size_t index,
                                 const VolumeLimits& limits) {
  Archive archive(file);
  if (absl::Status status = archive.Open(where, limits); !status.ok()) return status;
  if (index >= archive.size()) return CutShort(where);
  const vdb::io::GridDescriptor& descriptor = archive.Descriptor(index);
  const bool is_scalar = IsScalar(descriptor.gridType());
  if (!is_scalar && !IsVector(descriptor.gridType())) return NotReadable(where, descriptor);
  auto grid = archive.Read(where, index);
  if (!grid.ok()) return grid.status();
  if (!is_scalar) {
    return VectorImageOf(where, descriptor.gridName(), *grid, limits);
  }
  const vdb::FloatGrid::Ptr scalars = Scalars(*std::move(grid));
  // Distances are no density: the inside of the surface is one.
  if (scalars->getGridClass() == vdb::GRID_LEVEL_SET) vdb::tools::sdfToFogVolume(*scalars);
  return ImageOf<vdb::FloatGrid>(where, descriptor.gridName(), scalars, limits);
}

// Calls the function in this thread alone, and turns exceptions into errors.
template <typename Function>
auto Guarded(const std::string& where, const Function& function) -> decltype(function()) {
  try {
    decltype(function()) result = CutShort(where);
    // Also what parallel loops of destructors do.
    tbb::task_arena(1).execute([&] {
      static const bool is_ready = (vdb::initialize(), true);
      if (is_ready) result = function();
    });
    return result;
  } catch (const std::bad_alloc&) {
    return absl::ResourceExhaustedError(absl::StrCat(where, ": no memory to read its grids"));
  } catch (const std::ios_base::failure&) {
    return CutShort(where);
  } catch (const std::exception& error) {
    return absl::DataLossError(
        absl::StrCat(where, ": OpenVDB cannot read it (", error.what(), "); write it again"));
  }
}

absl::StatusOr<std::vector<VolumeFileEntry>> GuardedList(const std::string& where, int file,
                                                         const VolumeLimits& limits) {
  return Guarded(where, [&] { return List(where, file, limits); });
}
absl::StatusOr<VolumeBytes> GuardedRead(const std::string& where, int file, size_t index,
                                        const VolumeLimits& limits) {
  return Guarded(where, [&] { return Read(where, file, index, limits); });
}

}  // namespace
}  // namespace sheaf::volume

extern "C" {
extern const sheaf::volume::VdbLibrary sheaf_vdb_library;
const sheaf::volume::VdbLibrary sheaf_vdb_library = {.list = sheaf::volume::GuardedList,
                                                     .read = sheaf::volume::GuardedRead};
}
