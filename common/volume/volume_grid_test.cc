// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/volume_grid.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <vector>

#include "common/volume/volume_array.h"
#include "tests/support/volume/volume_writers.h"

namespace sheaf {
namespace {

using ::testing::HasSubstr;

uint64_t Mix(uint64_t v) {
  v = (v ^ (v >> 30)) * 0xbf58476d1ce4e5b9u;
  v = (v ^ (v >> 27)) * 0x94d049bb133111ebu;
  return v ^ (v >> 31);
}
double Random(uint64_t* state) {
  return static_cast<double>(Mix(*state += 0x9e3779b97f4a7c15u) >> 11) * 0x1p-53;
}

std::vector<float> RandomValues(size_t count, uint64_t seed) {
  std::vector<float> values(count);
  for (float& v : values) v = static_cast<float>(Random(&seed));
  return values;
}

// pbrt-v4's sampled grid, from its formulas, in double.
double SampledGrid(const VolumeArrayShape& shape, const std::vector<float>& values, Vec3d p) {
  double sum = 0;
  Vec3d s, whole;
  for (size_t a = 0; a < 3; ++a) {
    s[a] = (p[a] - shape.lo[a]) / (shape.hi[a] - shape.lo[a]) * shape.size[a] - 0.5;
    whole[a] = std::floor(s[a]);
  }
  for (int c = 0; c < 8; ++c) {
    const int offset[3] = {c & 1, (c >> 1) & 1, c >> 2};
    double weight = 1;
    int64_t at[3];
    bool inside = true;
    for (size_t a = 0; a < 3; ++a) {
      const double f = s[a] - whole[a];
      weight *= offset[a] != 0 ? f : 1 - f;
      at[a] = static_cast<int64_t>(whole[a]) + offset[a];
      inside &= at[a] >= 0 && at[a] < shape.size[a];
    }
    if (!inside) continue;
    sum += weight *
           values[static_cast<size_t>((at[2] * shape.size[1] + at[1]) * shape.size[0] + at[0])];
  }
  return sum;
}

TEST(VolumeGridTest, ArrayLookupsMatchPbrt) {
  const VolumeArrayShape shape{{13, 9, 21}, {-2, 0.5, 7}, {3, 1.5, 8.25}};
  const std::vector<float> values = RandomValues(13 * 9 * 21, 1);
  const auto grid = VolumeGridFromArray("a.pbrt:1:1", "density", shape, values);
  ASSERT_TRUE(grid.ok()) << grid.status();
  VolumeGrid::Cursor cursor(*grid);
  uint64_t state = 7;
  for (int i = 0; i < 20000; ++i) {
    Vec3d p;
    for (size_t a = 0; a < 3; ++a) {
      p[a] = shape.lo[a] + (1.4 * Random(&state) - 0.2) * (shape.hi[a] - shape.lo[a]);
    }
    const Vec3d index = TransformPoint(grid->index_from_medium(), p);
    ASSERT_NEAR(grid->At(index, &cursor), SampledGrid(shape, values, p), 1e-6);
  }
  EXPECT_EQ(grid->box().lo, (Vec3d{-0.5, -0.5, -0.5}));
  EXPECT_EQ(grid->box().hi, (Vec3d{12.5, 8.5, 20.5}));
}

TEST(VolumeGridTest, LookupsAreBoundedByTheirVoxels) {
  // Values over 60 orders of magnitude, and points within a rounding error of voxels.
  std::vector<float> values = RandomValues(16 * 16 * 16, 3);
  uint64_t state = 11;
  for (float& v : values) v = std::ldexp(v, static_cast<int>(Random(&state) * 200) - 100);
  const auto grid = VolumeGridFromArray("a", "density", {{16, 16, 16}, {}, {1, 1, 1}}, values);
  ASSERT_TRUE(grid.ok());
  VolumeGrid::Cursor cursor(*grid);
  for (int i = 0; i < 50000; ++i) {
    Vec3d p;
    Index3 lo;
    for (size_t a = 0; a < 3; ++a) {
      p[a] = -1 + 17 * Random(&state);
      if (i % 3 == 0) p[a] = std::nextafter(std::round(p[a]), i % 2 == 0 ? -100 : 100);
      lo[a] = static_cast<int32_t>(std::floor(p[a]));
    }
    std::vector<float> box(8);
    grid->ReadBox(lo, {lo[0] + 1, lo[1] + 1, lo[2] + 1}, box, &cursor);
    const float v = grid->At(p, &cursor);
    ASSERT_GE(v, *std::min_element(box.begin(), box.end()));
    ASSERT_LE(v, *std::max_element(box.begin(), box.end()));
  }
}

TEST(VolumeGridTest, PointsOutsideGiveTheBackground) {
  const std::vector<float> values(27, 1.0f);
  const auto grid = VolumeGridFromArray("a", "density", {{3, 3, 3}, {}, {1, 1, 1}}, values);
  ASSERT_TRUE(grid.ok());
  VolumeGrid::Cursor cursor(*grid);
  constexpr double kInf = std::numeric_limits<double>::infinity();
  for (const double x : {-1.0, 3.0, 1e9, -1e300, kInf, -kInf, std::nan("")}) {
    EXPECT_EQ(grid->At({x, 1, 1}, &cursor), 0.0f) << x;
    EXPECT_EQ(grid->At({1, 1, x}, &cursor), 0.0f) << x;
  }
  EXPECT_EQ(grid->At({1, 1, 1}, &cursor), 1.0f);
}

TEST(VolumeGridTest, ColorsAreLookedUpAsVectors) {
  const std::vector<Vec3f> values(8, Vec3f{0.25f, 0.5f, 1});
  const auto grid = VolumeGridFromArray("a", "rgb", {{2, 2, 2}, {}, {1, 1, 1}}, values);
  ASSERT_TRUE(grid.ok()) << grid.status();
  VolumeGrid::Cursor cursor(*grid);
  EXPECT_EQ(grid->VectorAt({0.5, 0.5, 0.5}, &cursor), (Vec3f{0.25f, 0.5f, 1}));
  EXPECT_EQ(grid->VectorAt({-0.5, 0, 0}, &cursor), (Vec3f{0.125f, 0.25f, 0.5f}));
}

TEST(VolumeGridTest, InvalidArraysAreRefused) {
  const std::vector<float> values(8, 1.0f);
  const auto message = [&](const VolumeArrayShape& shape) {
    const auto grid = VolumeGridFromArray("a.pbrt:4:2", "density", shape, values);
    return std::string(grid.status().message());
  };
  EXPECT_THAT(
      message({{2, 2, 3}, {}, {1, 1, 1}}),
      HasSubstr("a.pbrt:4:2: grid \"density\": nx * ny * nz = 2 * 2 * 3 values are expected"));
  EXPECT_THAT(message({{0, 2, 2}, {}, {1, 1, 1}}), HasSubstr("must lie in [1, 16777216]"));
  EXPECT_THAT(message({{2000000000, 2000000000, 2000000000}, {}, {1, 1, 1}}),
              HasSubstr("index_abs_max"));
  // The product overflows 64 bits.
  EXPECT_THAT(message({{1 << 24, 1 << 24, 1 << 24}, {}, {1, 1, 1}}), HasSubstr("are expected"));
  EXPECT_THAT(message({{2, 2, 2}, {}, {1, 0, 1}}), HasSubstr("p0 must be less than p1"));
  const std::vector<float> bad(8, std::nanf(""));
  EXPECT_THAT(
      std::string(
          VolumeGridFromArray("a", "density", {{2, 2, 2}, {}, {1, 1, 1}}, bad).status().message()),
      HasSubstr("NaN or infinity"));
}

TEST(VolumeGridTest, RolesComeFromNames) {
  EXPECT_EQ(VolumeRoleOf("density"), VolumeRole::kDensity);
  EXPECT_EQ(VolumeRoleOf("Temperature"), VolumeRole::kTemperature);
  EXPECT_EQ(VolumeRoleOf("vel"), VolumeRole::kVelocity);
  EXPECT_EQ(VolumeRoleOf("flames"), VolumeRole::kEmission);
  EXPECT_EQ(VolumeRoleOf("ls_bunny"), VolumeRole::kOther);
}

// An image with some of its words changed is rejected, or is a grid whose lookups stay inside the
// image; AddressSanitizer checks them.
TEST(VolumeGridTest, DamagedImagesAreRefusedOrHarmless) {
  for (const char* type : {"float", "Fp4", "FpN", "Vec3f"}) {
    testing::GridToWrite written{
        .lo = {-5, -5, -5}, .hi = {12, 12, 12}, .value = [](const testing::Voxel& v) {
          return static_cast<float>((v[0] * v[1] + v[2]) & 7);
        }};
    written.type = type;
    const std::string file = testing::NvdbFile({written}, testing::NvdbCodec::kNone);
    // After the file's head, the entry and the name.
    const std::string image = file.substr(16 + 176 + sizeof("density"));
    uint64_t state = 5;
    int read_count = 0, refused_count = 0;
    for (int i = 0; i < 300; ++i) {
      VolumeBytes bytes(image.size());
      std::memcpy(bytes.data(), image.data(), image.size());
      for (int change = 0; change < 1 + i % 3; ++change) {
        // The head, the tree, the root and the first nodes; or anywhere.
        const double range = i % 2 == 0 ? 2000 : static_cast<double>(image.size() - 8);
        const auto at = static_cast<size_t>(Random(&state) * range) & ~size_t{3};
        const uint64_t word =
            Mix(static_cast<uint64_t>(i)) >> static_cast<int>(Random(&state) * 64);
        std::memcpy(bytes.data() + at, &word, 4 + 4 * (static_cast<size_t>(i) & 1));
      }
      const auto grid = VolumeGrid::FromImage(std::move(bytes), "a.nvdb", {});
      if (!grid.ok()) {
        ++refused_count;
        continue;
      }
      ++read_count;
      VolumeGrid::Cursor cursor(*grid);
      for (int look_up = 0; look_up < 300; ++look_up) {
        const Vec3d p{Random(&state) * 20 - 7, Random(&state) * 20 - 7, Random(&state) * 20 - 7};
        if (grid->is_vector()) {
          grid->VectorAt(p, &cursor);
        } else {
          const float v = grid->At(p, &cursor);
          ASSERT_TRUE(v >= grid->info().values.min && v <= grid->info().values.max);
        }
      }
    }
    EXPECT_GT(refused_count, 10) << type;
    EXPECT_GT(read_count, 10) << type;
  }
}

}  // namespace
}  // namespace sheaf
