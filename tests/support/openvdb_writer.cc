// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/volume_writers.h"

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
#include <unistd.h>

#include <fstream>
#include <sstream>

namespace sheaf::testing {
namespace {

template <typename GridT>
openvdb::GridBase::Ptr MakeGrid(const GridToWrite& grid, const VdbOptions& options) {
  using Value = typename GridT::ValueType;
  const auto convert = [](float v) {
    if constexpr (std::is_same_v<Value, openvdb::Vec3s>) {
      return openvdb::Vec3s(v, 2 * v, 3 * v);
    } else {
      return Value(v);
    }
  };
  auto made = GridT::create(convert(grid.background));
  made->setName(grid.name);
  made->setGridClass(openvdb::GRID_FOG_VOLUME);
  made->setSaveFloatAsHalf(options.half);
  if (options.frustum) {
    made->setTransform(openvdb::math::Transform::createFrustumTransform(
        openvdb::BBoxd({0, 0, 0}, {10, 10, 10}), 0.5, 2.0));
  } else {
    auto transform = openvdb::math::Transform::createLinearTransform(grid.voxel_size);
    if (options.has_affine_rotation) transform->preRotate(0.5, openvdb::math::Y_AXIS);
    transform->postTranslate(openvdb::Vec3d(0.5));
    made->setTransform(transform);
  }
  auto accessor = made->getAccessor();
  for (int32_t x = grid.lo[0]; x <= grid.hi[0]; ++x) {
    for (int32_t y = grid.lo[1]; y <= grid.hi[1]; ++y) {
      for (int32_t z = grid.lo[2]; z <= grid.hi[2]; ++z) {
        accessor.setValue(openvdb::Coord(x, y, z), convert(grid.value({x, y, z})));
      }
    }
  }
  if (options.with_tile) {
    made->fill(openvdb::CoordBBox(openvdb::Coord(-128), openvdb::Coord(-1)), convert(2.0f));
  }
  return made;
}

}  // namespace

std::string VdbFile(const std::vector<GridToWrite>& grids, const VdbOptions& options) {
  openvdb::initialize();
  openvdb::GridPtrVec made;
  for (const GridToWrite& grid : grids) {
    made.push_back(grid.type == "Vec3f"    ? MakeGrid<openvdb::Vec3SGrid>(grid, options)
                   : grid.type == "double" ? MakeGrid<openvdb::DoubleGrid>(grid, options)
                                           : MakeGrid<openvdb::FloatGrid>(grid, options));
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
