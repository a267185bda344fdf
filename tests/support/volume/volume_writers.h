// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Volume files for tests, written by the libraries that define the formats: NanoVDB and OpenVDB,
// each used in one source file.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace sheaf::testing {

using Voxel = std::array<int32_t, 3>;

// value(voxel) in the voxels lo..hi, inclusive; background elsewhere.
struct GridToWrite {
  std::string name = "density";
  Voxel lo{0, 0, 0}, hi{9, 9, 9};
  float (*value)(const Voxel&) = nullptr;
  float background = 0;
  double voxel_size = 1;
  double offset = 0.5;  // The grid's, along each axis; only OpenVDB.
  // NanoVDB's types: "float", "Fp4", "Fp8", "Fp16", "FpN", "Vec3f" (value times (1, 2, 3)),
  // "double". OpenVDB's: "float", "double", "int32", "int64", "bool", "mask" (active where the
  // value is not 0), "Vec3f", "Vec3d", "Vec3i", "points" (none).
  std::string type = "float";
};

enum class NvdbCodec { kNone, kZip, kBlosc };
std::string NvdbFile(const std::vector<GridToWrite>& grids, NvdbCodec codec);

// Options of the OpenVDB writer.
struct VdbOptions {
  bool zip = false, blosc = false, active_mask = true;
  bool half = false;
  // Ten voxels wide in front, half as wide at the back, and as deep as they are wide.
  bool frustum = false;
  // Distances: values of at least the background become inactive, and uniform nodes tiles.
  bool level_set = false;
  // All grids share the first one's tree.
  bool as_instances = false;
  bool has_affine_rotation = false;
  // Adds a filled cube of 128^3 voxels, which becomes a tile.
  bool with_tile = false;
  bool as_stream = false;
};
std::string VdbFile(const std::vector<GridToWrite>& grids, const VdbOptions& options);

}  // namespace sheaf::testing
