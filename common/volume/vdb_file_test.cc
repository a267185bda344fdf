// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What OpenVDB reads for us, of files that it has written, has not, and of damaged ones.
#include "common/volume/vdb_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>

#include "common/base/file.h"
#include "common/math/vec.h"
#include "common/volume/volume_surface.h"
#include "tests/support/volume/volume_files.h"

namespace sheaf {
namespace {

using ::sheaf::testing::ExpectVoxels;
using ::sheaf::testing::GridToWrite;
using ::sheaf::testing::Lumps;
using ::sheaf::testing::Ramp;
using ::sheaf::testing::VdbFile;
using ::sheaf::testing::Voxel;
using ::testing::HasSubstr;

class VdbFileTest : public testing::VolumeFileTest {};

constexpr int kDamagesPerKind = 40;

TEST_F(VdbFileTest, ReadsVdbWrittenByOpenVdb) {
  const GridToWrite written{.lo = {-9, -3, 2}, .hi = {20, 12, 17}, .value = Ramp};
  for (const bool zip : {false, true}) {
    for (const bool blosc : {false, true}) {
      for (const bool active_mask : {false, true}) {
        const auto grid =
            Read(VdbFile({written}, {.zip = zip, .blosc = blosc, .active_mask = active_mask}));
        ASSERT_TRUE(grid.ok()) << grid.status() << zip << blosc << active_mask;
        ExpectVoxels(*grid, written, 0);
        EXPECT_EQ(grid->info().active_voxel_count, 30u * 16 * 16);
      }
    }
  }
}

TEST_F(VdbFileTest, ReadsVdbHalfFloatsStreamsAndBackgrounds) {
  GridToWrite written{.lo = {-9, -3, 2}, .hi = {20, 12, 17}, .value = Lumps};
  for (const bool zip : {false, true}) {
    for (const bool blosc : {false, true}) {
      const auto grid = Read(VdbFile({written}, {.zip = zip, .blosc = blosc, .half = true}));
      ASSERT_TRUE(grid.ok()) << grid.status();
      ExpectVoxels(*grid, written, 0);  // Halves hold sixteenths exactly.
    }
  }
  written.background = 0.5f;
  const auto stream = Read(VdbFile({written}, {.as_stream = true}));
  ASSERT_TRUE(stream.ok()) << stream.status();
  ExpectVoxels(*stream, written, 0);
}

TEST_F(VdbFileTest, ReadsVdbTiles) {
  const auto grid = Read(VdbFile({{.value = Lumps}}, {.with_tile = true}));
  ASSERT_TRUE(grid.ok()) << grid.status();
  VolumeGrid::Cursor cursor(*grid);
  EXPECT_EQ(grid->At({-64, -64, -64}, &cursor), 2.0f);
  EXPECT_EQ(grid->At({-64.25, -100.5, -127.75}, &cursor), 2.0f);
  EXPECT_EQ(grid->At({-128.5, -64, -64}, &cursor), 1.0f);
  EXPECT_EQ(grid->info().active_voxel_count, 128u * 128 * 128 + 1000);
  EXPECT_EQ(grid->UniformValue({-128, -128, -128}, {-1, -1, -1}), 2.0f);
  EXPECT_EQ(grid->UniformValue({-129, -128, -128}, {-1, -1, -1}), std::nullopt);
  EXPECT_EQ(grid->UniformValue({500, 500, 500}, {900, 900, 9000}), 0.0f);
}

// Ten voxels in a row, each as wide as the frustum is there: 1 in front, 2 at the back.
// Interpolation between them keeps their sum.
TEST_F(VdbFileTest, ResamplesVdbFrustums) {
  GridToWrite written{.value = [](const Voxel&) { return 2.0f; }};
  written.voxel_size = 9;  // Voxels of the width in front, and of the depth.
  const auto grid = Read(VdbFile({written}, {.frustum = true}));
  ASSERT_TRUE(grid.ok()) << grid.status();
  const auto width = [&](double z) {
    VolumeGrid::Cursor cursor(*grid);
    double sum = 0;
    for (double x = -20; x <= 20; x += 0.125) {
      const Vec3d p{x, 0, z};
      sum += 0.125 * grid->At(TransformPoint(grid->index_from_medium(), p), &cursor);
    }
    return sum / 2;
  };
  for (const double z : {0.5, 2.0, 4.5, 7.0, 8.5}) {
    const double expected = 10 * (1 + z / 9);
    EXPECT_NEAR(width(z), expected, 0.03 * expected) << z;
  }
  EXPECT_EQ(width(-3), 0);
  EXPECT_EQ(width(30), 0);
}

// Two lumps far apart take a few leaves; their box, at their own fineness, some millions of cells.
TEST_F(VdbFileTest, BoundsTheCellsOfResampledVdbFrustums) {
  constexpr int32_t kWidth = 8, kFar = 496;
  GridToWrite written{.hi = {kFar + kWidth - 1, kFar + kWidth - 1, 9}, .type = "mask"};
  written.value = [](const Voxel& v) {
    return (v[0] < kWidth && v[1] < kWidth) || (v[0] >= kFar && v[1] >= kFar) ? 1.0f : 0.0f;
  };
  written.voxel_size = 9;
  const auto grid = Read(VdbFile({written}, {.frustum = true}));
  ASSERT_TRUE(grid.ok()) << grid.status();
  double cells = 1;
  for (int axis = 0; axis < 3; ++axis) {
    cells *= grid->info().index_max[axis] - grid->info().index_min[axis] + 1;
  }
  EXPECT_LE(cells, 1 << 20);
  EXPECT_GT(cells, 1 << 17);  // As fine as the bound permits: sides are halved, cells by eights.
  EXPECT_EQ(grid->info().values.max, 1.0f);
}

float Ones(const Voxel& v) { return (v[0] + v[1]) % 3 == 0 ? 1.0f : 0.0f; }
float Wholes(const Voxel& v) { return std::round(Ramp(v)); }

TEST_F(VdbFileTest, ReadsVdbOfEveryType) {
  const struct {
    const char* type;
    float (*value)(const Voxel&);
  } cases[] = {{"float", Ramp},   {"double", Ramp}, {"int32", Wholes},
               {"int64", Wholes}, {"bool", Ones},   {"mask", Ones}};
  for (const auto& c : cases) {
    GridToWrite written{.lo = {-9, -3, 2}, .hi = {20, 12, 17}, .value = c.value};
    written.type = c.type;
    for (const bool packed : {false, true}) {
      const auto grid = Read(VdbFile({written}, {.zip = packed, .blosc = packed}));
      ASSERT_TRUE(grid.ok()) << c.type << grid.status();
      ExpectVoxels(*grid, written, 0);
    }
  }
  for (const char* type : {"Vec3f", "Vec3d", "Vec3i"}) {
    GridToWrite written{.name = "vel", .hi = {12, 3, 3}, .value = Wholes};
    written.type = type;
    const auto grid = Read(VdbFile({written}, {.zip = true}), "vel");
    ASSERT_TRUE(grid.ok()) << type << grid.status();
    VolumeGrid::Cursor cursor(*grid);
    const float x = Wholes({11, 2, 1});
    EXPECT_EQ(grid->VectorAt({11, 2, 1}, &cursor), (Vec3f{x, 2 * x, 3 * x})) << type;
  }
}

// Version 221, before node masks were compressed (2012): a stream of one leaf with the value 3 in a
// voxel. Source: what OpenVDB's readTopology and readBuffers do for that version.
std::string OldVdbFile() {
  std::string bytes;
  const auto add = [&bytes](const auto& value) {
    bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
  };
  const auto add_text = [&](const std::string& text) {
    add(static_cast<uint32_t>(text.size()));
    bytes += text;
  };
  const auto add_zeros = [&bytes](size_t count) { bytes.append(count, '\0'); };
  const auto add_mask = [&bytes](size_t size_bytes, bool first) {
    bytes.append(size_bytes, '\0')[bytes.size() - size_bytes] = first ? 1 : 0;
  };
  add(int64_t{0x56444220});
  for (const uint32_t version : {221, 1, 1}) add(version);
  add_zeros(2);  // Neither offsets nor compression.
  bytes += "01234567-89ab-cdef-0123-456789abcdef";
  add(0);  // No metadata.
  add(1);  // Grids.
  for (const char* text : {"density", "Tree_float_5_4_3", ""}) add_text(text);
  add_zeros(3 * sizeof(int64_t) + sizeof(uint32_t));
  add_text("TranslationMap");
  for (const double offset : {1.0, 2.0, 3.0}) add(offset);
  for (const int32_t word : {1, 0, 0, 1, 0, 0, 0}) add(word);  // Background, tiles, child, origin.
  for (const size_t side : {32, 16}) {
    const size_t slots = side * side * side;
    add_mask(slots / 8, true);
    add_mask(slots / 8, false);
    add_zeros((slots - 1) * sizeof(float));
  }
  add_mask(64, true);
  add_mask(64, true);
  add_zeros(3 * sizeof(int32_t));
  add(int8_t{1});  // Buffers.
  add(3.0f);
  add_zeros(511 * sizeof(float));
  return bytes;
}

TEST_F(VdbFileTest, ReadsVdbOfOldVersions) {
  const auto old = Read(OldVdbFile());
  ASSERT_TRUE(old.ok()) << old.status();
  VolumeGrid::Cursor cursor(*old);
  EXPECT_EQ(old->At({0, 0, 0}, &cursor), 3);
  EXPECT_EQ(old->At({0, 0, 1}, &cursor), 0);
  EXPECT_EQ(old->info().active_voxel_count, 1u);
  EXPECT_EQ(TransformPoint(old->medium_from_index(), {0, 0, 0}), (Vec3d{1, 2, 3}));
  const GridToWrite written{.lo = {-9, -3, 2}, .hi = {20, 12, 17}, .value = Ramp};
  for (const char version : {char(222), char(223)}) {  // The same for floats without Blosc.
    std::string bytes = VdbFile({written}, {.zip = true});
    bytes[8] = version;
    const auto grid = Read(bytes);
    ASSERT_TRUE(grid.ok()) << grid.status();
    ExpectVoxels(*grid, written, 0);
  }
  std::string older = OldVdbFile();
  older[8] = char(200);
  EXPECT_THAT(Message(older), HasSubstr("smoke.vdb: the file is cut short or damaged"));
}

float Sphere(const Voxel& v) {
  return static_cast<float>(std::sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])) - 12;
}

// The inside of the surface becomes a density of 1, with a ramp as wide as the band of distances.
TEST_F(VdbFileTest, VdbLevelSetsBecomeFog) {
  for (const char* type : {"float", "double"}) {
    GridToWrite written{.lo = {-20, -20, -20}, .hi = {20, 20, 20}, .value = Sphere};
    written.background = 3;
    written.type = type;
    const auto grid = Read(VdbFile({written}, {.level_set = true}));
    ASSERT_TRUE(grid.ok()) << grid.status();
    VolumeGrid::Cursor cursor(*grid);
    EXPECT_EQ(grid->At({0, 0, 0}, &cursor), 1);
    EXPECT_EQ(grid->At({8, 0, 0}, &cursor), 1);
    EXPECT_NEAR(grid->At({10, 0, 0}, &cursor), 2.0f / 3, 1e-6);
    EXPECT_EQ(grid->At({12, 0, 0}, &cursor), 0);
    EXPECT_EQ(grid->At({13, 0, 0}, &cursor), 0);
    EXPECT_EQ(grid->info().values, (ValueRange{0, 1}));
    EXPECT_TRUE(grid->CheckDensity("a").ok());
  }
}

// The volume that a closed mesh encloses, about a point near it.
struct Measured {
  double volume = 0, area = 0, radius_min = 1e300, radius_max = 0, normal_error_max = 0;
};
Measured Measure(const VolumeSurface& surface, const Vec3d& center) {
  Measured measured;
  const auto at = [&](size_t i) { return surface.positions[surface.triangles[i]] - center; };
  for (size_t i = 0; i < surface.triangles.size(); i += 3) {
    const Vec3d face = Cross(at(i + 1) - at(i), at(i + 2) - at(i));
    measured.area += Length(face) / 2;
    measured.volume += Dot(at(i), face) / 6;
  }
  for (size_t i = 0; i < surface.positions.size(); ++i) {
    const Vec3d out = surface.positions[i] - center;
    measured.radius_min = std::min(measured.radius_min, Length(out));
    measured.radius_max = std::max(measured.radius_max, Length(out));
    measured.normal_error_max = std::max(measured.normal_error_max,
                                         Length(ToDouble(surface.normals[i]) - out / Length(out)));
  }
  return measured;
}

// A ball of a radius of 12 voxels, near its grid's origin and ten thousand kilometers away.
TEST_F(VdbFileTest, VdbLevelSetsHaveSurfaces) {
  for (const double offset : {0.5, 1e7}) {
    GridToWrite written{.lo = {-20, -20, -20}, .hi = {20, 20, 20}, .value = Sphere};
    written.background = 3;
    written.voxel_size = 0.25;
    written.offset = offset;
    ASSERT_TRUE(WriteFileAtomically(path_, VdbFile({written}, {.level_set = true})).ok());
    const auto surface = ReadVolumeSurface("ball.vdb", path_, "", 0);
    ASSERT_TRUE(surface.ok()) << surface.status();
    const Measured ball = Measure(*surface, Vec3d{offset, offset, offset});
    EXPECT_NEAR(ball.radius_min, 3, 0.02) << offset;
    EXPECT_NEAR(ball.radius_max, 3, 0.02) << offset;
    EXPECT_NEAR(ball.area, 4 * M_PI * 9, 0.01 * 4 * M_PI * 9) << offset;
    EXPECT_NEAR(ball.volume, 4 * M_PI * 9, 0.01 * 4 * M_PI * 9) << offset;
    EXPECT_LT(ball.normal_error_max, 0.1) << offset;
  }
}

float Ball(const Voxel& v) { return -Sphere(v); }

// The body of a density has the larger values.
TEST_F(VdbFileTest, VdbDensitiesHaveSurfaces) {
  GridToWrite written{.lo = {-20, -20, -20}, .hi = {20, 20, 20}, .value = Ball};
  written.background = -9;
  ASSERT_TRUE(WriteFileAtomically(path_, VdbFile({written}, {.zip = true})).ok());
  for (const float isovalue : {0.0f, 4.0f}) {
    const auto surface = ReadVolumeSurface("ball.vdb", path_, "density", isovalue);
    ASSERT_TRUE(surface.ok()) << surface.status();
    const double radius = 12 - isovalue;
    const Measured ball = Measure(*surface, Vec3d{0.5, 0.5, 0.5});
    EXPECT_NEAR(ball.radius_min, radius, 0.1);
    EXPECT_NEAR(ball.volume, 4.0 / 3 * M_PI * radius * radius * radius, 0.02 * ball.volume);
  }
  const auto none = ReadVolumeSurface("ball.vdb", path_, "density", 40);
  ASSERT_TRUE(none.ok()) << none.status();
  EXPECT_TRUE(none->triangles.empty());
}

TEST_F(VdbFileTest, RefusesSurfacesOfOtherGrids) {
  GridToWrite vectors{.name = "vel", .value = Ramp};
  vectors.type = "Vec3f";
  const auto message = [&](const std::string& bytes, const std::string& grid,
                           const VolumeLimits& limits = {}) {
    EXPECT_TRUE(WriteFileAtomically(path_, bytes).ok());
    const auto surface = ReadVolumeSurface("ball.vdb", path_, grid, 0.5f, limits);
    return surface.ok() ? "" : std::string(surface.status().message());
  };
  const std::string both = VdbFile({vectors, {.value = Lumps}}, {});
  EXPECT_THAT(message(both, "vel"), HasSubstr("ball.vdb: grid \"vel\" is a Tree_vec3s_5_4_3, which "
                                              "has no surface; name a grid of numbers"));
  EXPECT_THAT(message(both, ""),
              HasSubstr("ball.vdb: has 2 grids, none without a name; name the one "
                        "that is meant (gridname): \"vel\" (Tree_vec3s_5_4_3), "));
  EXPECT_EQ(message(both, "density"), "");
  EXPECT_THAT(message(both, "density", {.grid_bytes_max = 1000}), HasSubstr("(grid_bytes_max)"));
  EXPECT_THAT(message(testing::NvdbFile({{.value = Lumps}}, testing::NvdbCodec::kNone), ""),
              HasSubstr("ball.vdb: is a NanoVDB file; surfaces are made of OpenVDB files"));
}

TEST_F(VdbFileTest, VdbInstancesHaveTheTreeOfAnotherGrid) {
  GridToWrite second{.name = "smoke", .value = Ramp};
  second.voxel_size = 0.5;
  for (const bool as_stream : {false, true}) {
    const std::string bytes =
        VdbFile({{.value = Lumps}, second}, {.as_instances = true, .as_stream = as_stream});
    const auto grid = Read(bytes, "smoke");
    ASSERT_TRUE(grid.ok()) << grid.status();
    EXPECT_EQ(grid->info().values.max, 15.0f / 16);
    EXPECT_EQ(grid->medium_from_index().m[0][0], 0.5);
    EXPECT_EQ(grid->info().name, "smoke");
  }
}

TEST_F(VdbFileTest, RefusesVdbWithoutValues) {
  GridToWrite points{.name = "drops"};
  points.type = "points";
  std::string bytes = VdbFile({points, {.value = Lumps}}, {});
  EXPECT_TRUE(Read(bytes).ok());
  EXPECT_THAT(Message(bytes, "drops"), HasSubstr("grid \"drops\" is a Tree_ptdataidx32_5_4_3, "
                                                 "which holds points, no values"));
  const size_t at = bytes.find("Tree_float_5_4_3");
  ASSERT_NE(at, std::string::npos);
  bytes.replace(at, 16, "Tree_other_5_4_3");
  EXPECT_THAT(Message(bytes), HasSubstr("is a Tree_other_5_4_3, which OpenVDB does not know; "));
}

// Whatever OpenVDB makes of a damaged file, it does so elsewhere: here is a grid, or one line.
TEST_F(VdbFileTest, DamagedVdbIsReadOrRefusedInOneLine) {
  GridToWrite vectors{.name = "vel", .value = Ramp};
  vectors.type = "Vec3d";
  const std::string kinds[] = {VdbFile({{.value = Lumps}}, {.active_mask = false}),
                               VdbFile({vectors, {.value = Lumps}}, {.zip = true, .half = true}),
                               VdbFile({{.value = Lumps}}, {.blosc = true, .frustum = true})};
  uint32_t random = 1;
  for (const std::string& bytes : kinds) {
    for (size_t i = 0; i < 20; ++i) {
      EXPECT_FALSE(Read(bytes.substr(0, bytes.size() * i / 20)).ok()) << i;
    }
    for (int i = 0; i < kDamagesPerKind; ++i) {
      std::string damaged = bytes;
      random = random * 1664525 + 1013904223;
      damaged[(random >> 3) % damaged.size()] ^= static_cast<char>(1 << (random & 7));
      const auto grid = Read(damaged);
      if (grid.ok()) continue;
      const std::string message(grid.status().message());
      EXPECT_THAT(message, ::testing::StartsWith("smoke.vdb: "));
      EXPECT_EQ(message.find('\n'), std::string::npos) << message;
    }
  }
}

}  // namespace
}  // namespace sheaf
