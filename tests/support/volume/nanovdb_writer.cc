// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/support/volume/volume_writers.h"

#define NANOVDB_USE_ZIP
#define NANOVDB_USE_BLOSC
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wpragmas"
#pragma GCC diagnostic ignored "-Wconversion"
#pragma GCC diagnostic ignored "-Wshadow"
#pragma GCC diagnostic ignored "-Wundef"
#pragma GCC diagnostic ignored "-Wpedantic"
#pragma GCC diagnostic ignored "-Wextra"
#pragma GCC diagnostic ignored "-Wall"
#include <nanovdb/util/GridBuilder.h>
#include <nanovdb/util/IO.h>

#include <sstream>

namespace sheaf::testing {
namespace {

template <typename ValueT, typename BuildT>
nanovdb::GridHandle<> Handle(const GridToWrite& grid) {
  const auto convert = [](float v) {
    if constexpr (std::is_same_v<ValueT, nanovdb::Vec3f>) {
      return nanovdb::Vec3f(v, 2 * v, 3 * v);
    } else {
      return ValueT(v);
    }
  };
  nanovdb::GridBuilder<ValueT, BuildT> builder(convert(grid.background),
                                               std::is_same_v<ValueT, nanovdb::Vec3f>
                                                   ? nanovdb::GridClass::Unknown
                                                   : nanovdb::GridClass::FogVolume);
  auto accessor = builder.getAccessor();
  for (int32_t x = grid.lo[0]; x <= grid.hi[0]; ++x) {
    for (int32_t y = grid.lo[1]; y <= grid.hi[1]; ++y) {
      for (int32_t z = grid.lo[2]; z <= grid.hi[2]; ++z) {
        accessor.setValue(nanovdb::Coord(x, y, z), convert(grid.value({x, y, z})));
      }
    }
  }
  return builder.getHandle(grid.voxel_size, nanovdb::Vec3d(0.5), grid.name);
}

nanovdb::GridHandle<> HandleOf(const GridToWrite& grid) {
  if (grid.type == "Fp4") return Handle<float, nanovdb::Fp4>(grid);
  if (grid.type == "Fp8") return Handle<float, nanovdb::Fp8>(grid);
  if (grid.type == "Fp16") return Handle<float, nanovdb::Fp16>(grid);
  if (grid.type == "FpN") return Handle<float, nanovdb::FpN>(grid);
  if (grid.type == "Vec3f") return Handle<nanovdb::Vec3f, nanovdb::Vec3f>(grid);
  if (grid.type == "double") return Handle<double, double>(grid);
  return Handle<float, float>(grid);
}

}  // namespace

std::string NvdbFile(const std::vector<GridToWrite>& grids, NvdbCodec codec) {
  std::vector<nanovdb::GridHandle<>> handles;
  for (const GridToWrite& grid : grids) handles.push_back(HandleOf(grid));
  // The writer skips the space of the header and writes it last, so the string must already hold
  // it.
  std::ostringstream out(std::string(4096 * (1 + grids.size()), '\0'));
  nanovdb::io::writeGrids(out, handles,
                          codec == NvdbCodec::kNone  ? nanovdb::io::Codec::NONE
                          : codec == NvdbCodec::kZip ? nanovdb::io::Codec::ZIP
                                                     : nanovdb::io::Codec::BLOSC);
  const auto size = static_cast<size_t>(out.tellp());
  return out.str().substr(0, size);
}

}  // namespace sheaf::testing
#pragma GCC diagnostic pop
