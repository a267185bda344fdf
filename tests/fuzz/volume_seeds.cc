// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Writes the corpora of the targets volume, vdb and pages, which are too large for the repository,
// below a folder: small files of NanoVDB and OpenVDB, one for each kind of content and compression,
// and page files.
//
//   volume_seeds FOLDER
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "common/volume/page_maker.h"
#include "tests/support/volume/volume_writers.h"

namespace {

using sheaf::testing::GridToWrite;
using sheaf::testing::NvdbCodec;

float Value(const sheaf::testing::Voxel& v) {
  return static_cast<float>((v[0] * 7 + v[1] * 13 + v[2] * 5) & 15) / 16;
}

GridToWrite GridOf(const char* type) {
  GridToWrite grid{.lo = {-2, -2, -2}, .hi = {5, 5, 5}, .value = Value};
  grid.type = type;
  return grid;
}

std::vector<std::string> NvdbSeeds() {
  std::vector<std::string> seeds;
  for (const char* type : {"float", "Fp4", "Fp8", "Fp16", "FpN", "Vec3f"}) {
    seeds.push_back(sheaf::testing::NvdbFile({GridOf(type)}, NvdbCodec::kNone));
  }
  seeds.push_back(sheaf::testing::NvdbFile({GridOf("float")}, NvdbCodec::kZip));
  seeds.push_back(sheaf::testing::NvdbFile({GridOf("float")}, NvdbCodec::kBlosc));
  return seeds;
}

std::vector<std::string> VdbSeeds() {
  std::vector<std::string> seeds;
  const GridToWrite grid = GridOf("float");
  for (const bool active_mask : {false, true}) {
    for (const bool half : {false, true}) {
      seeds.push_back(sheaf::testing::VdbFile({grid}, {.active_mask = active_mask, .half = half}));
    }
  }
  seeds.push_back(sheaf::testing::VdbFile({grid}, {.zip = true}));
  seeds.push_back(sheaf::testing::VdbFile({grid}, {.blosc = true, .frustum = true}));
  seeds.push_back(sheaf::testing::VdbFile({GridOf("Vec3f"), grid}, {}));
  for (const char* type : {"double", "int64", "bool", "mask", "Vec3d", "points"}) {
    seeds.push_back(sheaf::testing::VdbFile({GridOf(type)}, {.level_set = type[0] == 'd'}));
  }
  seeds.push_back(sheaf::testing::VdbFile({grid, grid}, {.as_instances = true, .as_stream = true}));
  return seeds;
}

void Write(const std::vector<std::string>& seeds, const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  for (size_t i = 0; i < seeds.size(); ++i) {
    std::ofstream(folder / std::to_string(i), std::ios::binary) << seeds[i];
  }
}

// A page file for each kind of values. False if one cannot be made.
bool WritePages(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  for (const char* type : {"float", "Fp4", "Fp8", "Fp16", "FpN"}) {
    const std::filesystem::path volume = folder / "volume";
    std::ofstream(volume, std::ios::binary)
        << sheaf::testing::NvdbFile({GridOf(type)}, NvdbCodec::kNone);
    const auto made = sheaf::MakePageFile("volume", volume.string(), (folder / type).string());
    std::filesystem::remove(volume);
    if (!made.ok()) return false;
  }
  return true;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) {
    std::fprintf(stderr, "usage: volume_seeds FOLDER\n");
    return 2;
  }
  const std::filesystem::path folder = arguments[1];
  Write(NvdbSeeds(), folder / "volume");
  Write(VdbSeeds(), folder / "vdb");
  return WritePages(folder / "pages") ? 0 : 1;
}
