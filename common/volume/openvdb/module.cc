// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// libsheaf_openvdb.so: the door to OpenVDB, one translation unit, because its templates take long
// to compile. Reads grids of .vdb files, brings them into trees of float or of three floats on
// straight axes, and copies these into NanoVDB images, or meshes them. OpenVDB trusts its input and
// throws: this code runs in confined processes, and lets no exception out.
//
//     FileBuffer > Archive > GridBase > Scalars > FloatGrid, Vec3SGrid ... > ImageOf, SurfaceOf
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
#include "common/volume/grid_names.h"
#include "common/volume/image_builder.h"
#include "common/volume/openvdb/archive.h"
#include "common/volume/openvdb/headers.h"
#include "common/volume/openvdb/surface.h"
#include "common/volume/vdb_library.h"

namespace sheaf::volume {
namespace {

// Cells of the box around a frustum that is resampled: for each stored voxel, at least, and at
// most. A small file must not take minutes.
constexpr double kResampledCellsPerVoxel = 64;
constexpr double kResampledCellsMin = 1 << 20;
constexpr double kResampledCellsMax = 1 << 27;

// The transform of a grid of cubes that covers the active voxels of a grid on other axes, as fine
// as its finest voxel, or as cells_max allows. Null if there is none.
vdb::math::Transform::Ptr StraightAxes(const vdb::math::Transform& bent,
                                       const vdb::CoordBBox& voxels, double cells_max) {
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
  while (cells(side) > cells_max) side *= 2;
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
  const double stored = static_cast<double>(grid->constTree().leafCount()) *
                        static_cast<double>(GridT::TreeType::LeafNodeType::SIZE);
  const auto transform = StraightAxes(
      grid->transform(), voxels,
      std::clamp(kResampledCellsPerVoxel * stored, kResampledCellsMin, kResampledCellsMax));
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
  NumberSharedNames(&entries);
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
absl::StatusOr<VolumeSurface> GuardedSurface(const std::string& where, int file, size_t index,
                                             float isovalue, const VolumeLimits& limits) {
  return Guarded(where, [&] { return SurfaceOf(where, file, index, isovalue, limits); });
}

}  // namespace
}  // namespace sheaf::volume

extern "C" {
extern const sheaf::volume::VdbLibrary sheaf_vdb_library;
const sheaf::volume::VdbLibrary sheaf_vdb_library = {.list = sheaf::volume::GuardedList,
                                                     .read = sheaf::volume::GuardedRead,
                                                     .surface = sheaf::volume::GuardedSurface};
}
