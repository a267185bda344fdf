// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The cost of preparing a volume grid (read, verify, compute majorants), of lookups, and of
// tracking rays through it with local and with global majorants.
//
//   volume_bench [GIBIBYTES = 1] [THREADS = 1]
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <string>
#include <vector>

#include "common/base/check.h"
#include "common/volume/image_builder.h"
#include "common/volume/volume_file.h"
#include "worker/render/medium/cloud_density.h"
#include "worker/render/medium/delta_tracking.h"

namespace {

using sheaf::Index3;
using sheaf::Vec3d;
using namespace sheaf::render;  // NOLINT: a program of this module.

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}
double PeakMebibytes() {
  struct rusage usage {};
  ::getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024;
}

// A shell of noise like a cloud: dense inside, thin at its boundary, empty around it.
std::string MakeFile(double gibibytes) {
  using Builder = sheaf::volume::ImageBuilder<float>;
  const auto leaf_count = static_cast<uint64_t>(gibibytes * (1 << 30) / sizeof(Builder::Leaf));
  const double radius = std::cbrt(static_cast<double>(leaf_count) * 3 / (4 * sheaf::kPi));
  const int32_t lowers = 2 * static_cast<int32_t>(radius / 16 + 1);
  SHEAF_CHECK(lowers <= 32);
  const double middle = lowers * 8;
  const auto is_in = [&](int32_t x, int32_t y, int32_t z) {
    const Vec3d d{x + 0.5 - middle, y + 0.5 - middle, z + 0.5 - middle};
    return sheaf::Length(d) < radius;
  };
  sheaf::volume::NodeCounts counts{1, 1, static_cast<uint64_t>(lowers) * lowers * lowers, 0};
  for (int32_t x = 0; x < lowers * 16; ++x) {
    for (int32_t y = 0; y < lowers * 16; ++y) {
      for (int32_t z = 0; z < lowers * 16; ++z) counts.leaf += is_in(x, y, z);
    }
  }
  auto builder = Builder::Make("bench", "density", {}, counts, 0, {});
  SHEAF_CHECK(builder.ok());
  auto* upper = builder->AddUpper({0, 0, 0});
  for (int32_t n = 0; n < lowers * lowers * lowers; ++n) {
    const int32_t lx = n / (lowers * lowers), ly = n / lowers % lowers, lz = n % lowers;
    auto* lower = builder->AddLower(upper, static_cast<uint32_t>((lx << 10) | (ly << 5) | lz));
    for (uint32_t c = 0; c < 4096; ++c) {
      const Index3 at{lx * 16 + static_cast<int32_t>(c >> 8),
                      ly * 16 + static_cast<int32_t>((c >> 4) & 15),
                      lz * 16 + static_cast<int32_t>(c & 15)};
      if (!is_in(at[0], at[1], at[2])) continue;
      auto& leaf = *builder->AddLeaf(lower, c)->data();
      std::memset(static_cast<void*>(&leaf.mValueMask), 0xff, sizeof(leaf.mValueMask));
      // Noise on two scales: lumps of several leaf nodes, and voxels.
      const double lump =
          GradientNoise({at[0] * 0.37 + 0.1, at[1] * 0.37 + 0.2, at[2] * 0.37 + 0.3});
      for (uint32_t v = 0; v < 512; ++v) {
        const uint32_t hash = (v * 2654435761u + c * 40503u) >> 16;
        leaf.mValues[v] = static_cast<float>(std::max(0.0, 0.2 + lump)) *
                          (0.75f + static_cast<float>(hash & 255) / 1024);
      }
    }
  }
  const sheaf::VolumeBytes image = (*std::move(builder)).TakeImage();
  const std::string path = "/tmp/sheaf-volume-bench-" + std::to_string(::getpid()) + ".nvdb";
  std::ofstream out(path, std::ios::binary);
  const uint64_t head[2] = {0x304244566f6e614e, (uint64_t{1} << 32) | (32u << 21)};
  out.write(reinterpret_cast<const char*>(head), sizeof(head));
  char entry[176] = {};
  const uint64_t sizes[2] = {image.size(), image.size()};
  const uint32_t type = 1, name_size = 8;
  std::memcpy(entry, sizes, sizeof(sizes));
  std::memcpy(entry + 32, &type, sizeof(type));
  std::memcpy(entry + 136, &name_size, sizeof(name_size));
  out.write(entry, sizeof(entry));
  out.write("density", 8);
  out.write(reinterpret_cast<const char*>(image.data()),
            static_cast<std::streamsize>(image.size()));
  out.close();
  SHEAF_CHECK(out.good());
  return path;
}

void BenchLookUps(const sheaf::VolumeGrid& grid) {
  sheaf::VolumeGrid::Cursor cursor(grid);
  constexpr int kCount = 4000000;
  const sheaf::IndexBox& box = grid.box();
  EventStream random({1, 1, 1, 1});
  double sum = 0;
  double begin = Now();
  for (int ray = 0; ray < kCount / 1000; ++ray) {
    Vec3d p =
        box.lo + Vec3d{random.Uniform(), random.Uniform(), random.Uniform()} * (box.hi - box.lo);
    const Vec3d step{0.3, 0.2 * random.Uniform(), -0.1};
    for (int i = 0; i < 1000; ++i, p += step) sum += grid.At(p, &cursor);
  }
  std::printf("look-ups along rays   %6.1f M/s\n", kCount / (Now() - begin) * 1e-6);
  begin = Now();
  for (int i = 0; i < kCount / 4; ++i) {
    sum += grid.At(
        box.lo + Vec3d{random.Uniform(), random.Uniform(), random.Uniform()} * (box.hi - box.lo),
        &cursor);
  }
  std::printf("look-ups at random    %6.1f M/s  (mean density %.4f)\n",
              kCount / 4 / (Now() - begin) * 1e-6, sum / (1.25 * kCount));
}

struct GlobalWalk {
  MajorantSegment segment;
  bool Next(MajorantSegment* out) {
    if (segment.t0 >= segment.t1) return false;
    *out = segment;
    segment.t0 = segment.t1;
    return true;
  }
};

void BenchTracking(const sheaf::VolumeGrid& grid, const MajorantGrid& majorants, double thickness) {
  const sheaf::IndexBox& box = grid.box();
  const Vec3d size = box.hi - box.lo;
  const auto sigma = static_cast<float>(thickness / size.x);
  for (const bool is_local : {true, false}) {
    sheaf::VolumeGrid::Cursor cursor(grid);
    TrackingTally tally;
    int ray_count = 0;
    double passed = 0;
    const double begin = Now();
    for (uint32_t i = 0; Now() - begin < 1; ++i, ++ray_count) {
      EventStream stream({i, 2, 2, 2});
      const Vec3d o = box.lo + Vec3d{-0.01, stream.Uniform(), stream.Uniform()} * size;
      const Vec3d to = box.lo + Vec3d{1.01, stream.Uniform(), stream.Uniform()} * size;
      const Vec3d d = sheaf::Normalize(to - o);
      const double t_max = sheaf::Length(to - o);
      const auto density = [&](double t) { return grid.At(o + t * d, &cursor); };
      if (is_local) {
        MajorantWalk walk(majorants, o, d, 0, t_max);
        passed += TrackTransmittance(&walk, density, sheaf::Rgb::Gray(sigma), &stream, &tally).r;
      } else {
        GlobalWalk walk{{0, t_max, majorants.bounds()}};
        passed += TrackTransmittance(&walk, density, sheaf::Rgb::Gray(sigma), &stream, &tally).r;
      }
    }
    const double count = ray_count;
    std::printf("thickness %7.1f %s %7.2f us/ray %7.1f look-ups %7.1f segments  T %.4f\n",
                thickness, is_local ? "local " : "global", (Now() - begin) / count * 1e6,
                static_cast<double>(tally.look_up_count) / count,
                static_cast<double>(tally.segment_count) / count, passed / count);
  }
}

}  // namespace

int main(int count, char** arguments) {
  const double gibibytes = count > 1 ? std::strtod(arguments[1], nullptr) : 1;
  const int threads = count > 2 ? static_cast<int>(std::strtol(arguments[2], nullptr, 10)) : 1;
  if (count <= 3) {
    // A separate process makes the file, so that the peak memory is that of reading it.
    const std::string command =
        std::string(arguments[0]) + " " + std::to_string(gibibytes) + " 1 make";
    std::FILE* maker = ::popen(command.c_str(), "r");
    char path[256] = {};
    SHEAF_CHECK(maker != nullptr && std::fgets(path, sizeof(path), maker) != nullptr);
    ::pclose(maker);
    path[std::strcspn(path, "\n")] = 0;
    double begin = Now();
    {
      std::vector<char> buffer(1 << 24);
      std::ifstream file(path, std::ios::binary);
      while (file.read(buffer.data(), static_cast<std::streamsize>(buffer.size()))) {
      }
    }
    const double read = Now() - begin;
    begin = Now();
    const auto grid = sheaf::ReadVolumeGrid("bench", path, "density", {}, threads);
    const double ready = Now() - begin;
    ::unlink(path);
    SHEAF_CHECK(grid.ok());
    const double grid_mib = static_cast<double>(grid->info().memory_bytes) / (1 << 20);
    for (const double extinction : {0.01, 1.0}) {
      begin = Now();
      const MajorantGrid majorants = MajorantGrid::Build(
          GridDensitySource(*grid), {.extinction_per_voxel = extinction, .thread_count = threads});
      const double built = Now() - begin;
      std::printf(
          "grid %.0f MiB: reading alone %.2f s, read and verified %.2f s; majorants for "
          "extinction %.2f: %.2f s, %.1f MiB; peak %.0f MiB = %.2f of the grid\n",
          grid_mib, read, ready, extinction, built,
          static_cast<double>(majorants.memory_bytes()) / (1 << 20), PeakMebibytes(),
          PeakMebibytes() / grid_mib);
      const double side = grid->box().hi.x - grid->box().lo.x;
      BenchTracking(*grid, majorants, extinction * side);
      if (extinction < 1) BenchTracking(*grid, majorants, 1);
    }
    BenchLookUps(*grid);
    return 0;
  }
  std::printf("%s\n", MakeFile(gibibytes).c_str());
  return 0;
}
