// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/volume/volume_writers.h"

#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpragmas"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wundef"
#pragma GCC diagnostic ignored "-Wpedantic"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wall"
#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Prune.h>
#include <unistd.h>

#include <fstream>
#include <sstream>

namespace sheaf::testing {
namespace {

template <typename Value>
Value Convert(float v) {
  if constexpr (openvdb::VecTraits<Value>::IsVec) {
    using Number = typename Value::value_type;
    return Value(Number(v), Number(2 * v), Number(3 * v));
  } else {
    return Value(v);
  }
}

openvdb::math::Transform::Ptr MakeTransform(const GridToWrite& grid, const VdbOptions& options) {
  if (options.frustum) {
    return openvdb::math::Transform::createFrustumTransform(openvdb::BBoxd({0, 0, 0}, {9, 9, 9}),
                                                            0.5, 1.0, grid.voxel_size);
  }
  auto transform = openvdb::math::Transform::createLinearTransform(grid.voxel_size);
  if (options.has_affine_rotation) transform->preRotate(0.5, openvdb::math::Y_AXIS);
  transform->postTranslate(openvdb::Vec3d(grid.offset));
  return transform;
}

template <typename GridT>
void Fill(const GridToWrite& grid, const VdbOptions& options, GridT* made) {
  using Value = typename GridT::ValueType;
  auto accessor = made->getAccessor();
  for (int32_t x = grid.lo[0]; x <= grid.hi[0]; ++x) {
    for (int32_t y = grid.lo[1]; y <= grid.hi[1]; ++y) {
      for (int32_t z = grid.lo[2]; z <= grid.hi[2]; ++z) {
        const float v = grid.value({x, y, z});
        const openvdb::Coord at(x, y, z);
        if constexpr (std::is_same_v<GridT, openvdb::MaskGrid>) {
          if (v != 0) accessor.setValueOn(at);
        } else if (options.level_set && std::abs(v) >= grid.background) {
          accessor.setValueOff(at, Convert<Value>(v < 0 ? -grid.background : grid.background));
        } else {
          accessor.setValue(at, Convert<Value>(v));
        }
      }
    }
  }
}

template <typename GridT>
openvdb::GridBase::Ptr MakeGrid(const GridToWrite& grid, const VdbOptions& options) {
  using Value = typename GridT::ValueType;
  typename GridT::Ptr made;
  if constexpr (std::is_same_v<GridT, openvdb::MaskGrid>) {
    made = GridT::create();
  } else {
    made = GridT::create(Convert<Value>(grid.background));
  }
  made->setGridClass(options.level_set ? openvdb::GRID_LEVEL_SET : openvdb::GRID_FOG_VOLUME);
  made->setSaveFloatAsHalf(options.half);
  Fill(grid, options, &*made);
  if constexpr (std::is_same_v<GridT, openvdb::FloatGrid>) {
    if (options.level_set) openvdb::tools::pruneLevelSet(made->tree());
    if (options.with_tile) {
      made->fill(openvdb::CoordBBox(openvdb::Coord(-128), openvdb::Coord(-1)), 2.0f);
    }
  }
  return made;
}

openvdb::GridBase::Ptr MakeGridOfType(const GridToWrite& grid, const VdbOptions& options) {
  if (grid.type == "double") return MakeGrid<openvdb::DoubleGrid>(grid, options);
  if (grid.type == "int32") return MakeGrid<openvdb::Int32Grid>(grid, options);
  if (grid.type == "int64") return MakeGrid<openvdb::Int64Grid>(grid, options);
  if (grid.type == "bool") return MakeGrid<openvdb::BoolGrid>(grid, options);
  if (grid.type == "mask") return MakeGrid<openvdb::MaskGrid>(grid, options);
  if (grid.type == "Vec3f") return MakeGrid<openvdb::Vec3SGrid>(grid, options);
  if (grid.type == "Vec3d") return MakeGrid<openvdb::Vec3DGrid>(grid, options);
  if (grid.type == "Vec3i") return MakeGrid<openvdb::Vec3IGrid>(grid, options);
  if (grid.type == "points") return openvdb::GridBase::createGrid("Tree_ptdataidx32_5_4_3");
  return MakeGrid<openvdb::FloatGrid>(grid, options);
}

}  // namespace

std::string VdbFile(const std::vector<GridToWrite>& grids, const VdbOptions& options) {
  openvdb::initialize();
  openvdb::GridPtrVec made;
  for (const GridToWrite& grid : grids) {
    made.push_back(MakeGridOfType(grid, options));
    made.back()->setName(grid.name);
    made.back()->setTransform(MakeTransform(grid, options));
    if (options.as_instances) made.back()->setTree(made.front()->baseTreePtr());
  }
  const uint32_t compression = (options.zip ? openvdb::io::COMPRESS_ZIP : 0u) |
                               (options.blosc ? openvdb::io::COMPRESS_BLOSC : 0u) |
                               (options.active_mask ? openvdb::io::COMPRESS_ACTIVE_MASK : 0u);
  std::ostringstream bytes;
  if (options.as_stream) {
    openvdb::io::Stream stream(bytes);
    stream.setCompression(compression);
    stream.write(made);
    return bytes.str();
  }
  const std::string path = "/tmp/sheaf-test-" + std::to_string(::getpid()) + ".vdb";
  openvdb::io::File file(path);
  file.setCompression(compression);
  file.write(made);
  file.close();
  bytes << std::ifstream(path, std::ios::binary).rdbuf();
  ::unlink(path.c_str());
  return bytes.str();
}

}  // namespace sheaf::testing
#pragma GCC diagnostic pop
