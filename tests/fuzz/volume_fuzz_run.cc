// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// A short run of volume_fuzz without libFuzzer: files written by NanoVDB and OpenVDB with some
// bytes changed.
//
//   volume_fuzz_run ITERATIONS [SEED]      changes files and reads them
//   volume_fuzz_run --write-corpus FOLDER  writes the unchanged files as a corpus for libFuzzer
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "tests/support/volume_writers.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* bytes, size_t size_bytes);

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

uint64_t Next(uint64_t* state) {
  uint64_t v = *state += 0x9e3779b97f4a7c15u;
  v = (v ^ (v >> 30)) * 0xbf58476d1ce4e5b9u;
  v = (v ^ (v >> 27)) * 0x94d049bb133111ebu;
  return v ^ (v >> 31);
}

// Relevant words (sizes, offsets) are at multiples of 4, most of them near the beginning.
void Change(std::string* bytes, uint64_t* state) {
  const uint64_t kind = Next(state) % 8;
  const uint64_t range = Next(state) % 2 == 0 ? std::min<uint64_t>(bytes->size(), 2048)
                                              : static_cast<uint64_t>(bytes->size());
  if (range < 16) return;
  uint64_t at = Next(state) % (range - 8);
  if (kind < 6) at &= ~uint64_t{3};
  const uint64_t word = kind == 0   ? ~uint64_t{0}
                        : kind == 1 ? 0
                                    : Next(state) >> (Next(state) % 64);
  if (kind == 7) {
    bytes->resize(at);
    return;
  }
  const uint64_t count = kind == 6 ? 1 : 4 + 4 * (Next(state) % 2);
  for (uint64_t i = 0; i < count; ++i) (*bytes)[at + i] = static_cast<char>(word >> (8 * i));
}

}  // namespace

int main(int count, char** arguments) {
  const std::vector<std::string> seeds = Seeds();
  if (count == 3 && std::string(arguments[1]) == "--write-corpus") {
    for (size_t i = 0; i < seeds.size(); ++i) {
      std::ofstream(std::string(arguments[2]) + "/" + std::to_string(i), std::ios::binary)
          << seeds[i];
    }
    return 0;
  }
  const long iterations = count > 1 ? std::strtol(arguments[1], nullptr, 10) : 2000;
  uint64_t state = count > 2 ? std::strtoull(arguments[2], nullptr, 10) : 1;
  for (long i = 0; i < iterations; ++i) {
    std::string bytes = seeds[static_cast<size_t>(i) % seeds.size()];
    for (uint64_t change = 0; change <= Next(&state) % 4; ++change) Change(&bytes, &state);
    LLVMFuzzerTestOneInput(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size());
  }
  std::printf("%ld files read\n", iterations);
  return 0;
}
