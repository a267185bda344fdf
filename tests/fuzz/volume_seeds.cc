// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Writes the corpus of the target volume, which is too large for the repository: small files of
// NanoVDB and OpenVDB, one for each kind of content and compression.
//
//   volume_seeds FOLDER
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "tests/support/volume_writers.h"

namespace {

using sheaf::testing::GridToWrite;
using sheaf::testing::NvdbCodec;

std::vector<std::string> Seeds() {
  std::vector<std::string> seeds;
  const auto value = [](const sheaf::testing::Voxel& v) {
    return static_cast<float>((v[0] * 7 + v[1] * 13 + v[2] * 5) & 15) / 16;
  };
  for (const char* type : {"float", "Fp4", "Fp8", "Fp16", "FpN", "Vec3f"}) {
    GridToWrite grid{.lo = {-2, -2, -2}, .hi = {5, 5, 5}, .value = value};
    grid.type = type;
    seeds.push_back(sheaf::testing::NvdbFile({grid}, NvdbCodec::kNone));
  }
  const GridToWrite grid{.lo = {-2, -2, -2}, .hi = {5, 5, 5}, .value = value};
  seeds.push_back(sheaf::testing::NvdbFile({grid}, NvdbCodec::kZip));
  seeds.push_back(sheaf::testing::NvdbFile({grid}, NvdbCodec::kBlosc));
  for (const bool active_mask : {false, true}) {
    for (const bool half : {false, true}) {
      seeds.push_back(sheaf::testing::VdbFile({grid}, {.active_mask = active_mask, .half = half}));
    }
  }
  seeds.push_back(sheaf::testing::VdbFile({grid}, {.zip = true}));
  seeds.push_back(sheaf::testing::VdbFile({grid}, {.blosc = true}));
  GridToWrite vectors = grid;
  vectors.type = "Vec3f";
  seeds.push_back(sheaf::testing::VdbFile({vectors, grid}, {}));
  return seeds;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 2) {
    std::fprintf(stderr, "usage: volume_seeds FOLDER\n");
    return 2;
  }
  const std::filesystem::path folder = arguments[1];
  std::filesystem::create_directories(folder);
  const std::vector<std::string> seeds = Seeds();
  for (size_t i = 0; i < seeds.size(); ++i) {
    std::ofstream(folder / std::to_string(i), std::ios::binary) << seeds[i];
  }
  return 0;
}
