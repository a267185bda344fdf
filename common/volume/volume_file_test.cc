// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/volume/volume_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "common/base/file.h"
#include "common/volume/page_maker.h"
#include "tests/support/temporary_path.h"
#include "tests/support/volume/volume_files.h"

namespace sheaf {
namespace {

using ::sheaf::testing::ExpectVoxels;
using ::sheaf::testing::GridToWrite;
using ::sheaf::testing::Lumps;
using ::sheaf::testing::NvdbCodec;
using ::sheaf::testing::NvdbFile;
using ::sheaf::testing::Ramp;
using ::sheaf::testing::TemporaryPath;
using ::sheaf::testing::VdbFile;
using ::sheaf::testing::VolumeFileTest;
using ::sheaf::testing::Voxel;
using ::testing::HasSubstr;

TEST_F(VolumeFileTest, ReadsNvdbOfEveryCodec) {
  const GridToWrite written{.lo = {-9, -3, 2}, .hi = {20, 12, 17}, .value = Ramp};
  for (const NvdbCodec codec : {NvdbCodec::kNone, NvdbCodec::kZip, NvdbCodec::kBlosc}) {
    const auto grid = Read(NvdbFile({written}, codec));
    ASSERT_TRUE(grid.ok()) << grid.status();
    ExpectVoxels(*grid, written, 0);
    EXPECT_EQ(grid->info().index_min, (Index3{-9, -3, 2}));
    EXPECT_EQ(grid->info().index_max, (Index3{20, 12, 17}));
    EXPECT_EQ(grid->info().active_voxel_count, 30u * 16 * 16);
    EXPECT_EQ(grid->info().values, (ValueRange{0, Ramp({20, 12, 17})}));
    EXPECT_EQ(grid->info().role, VolumeRole::kDensity);
    EXPECT_EQ(grid->box().lo, (Vec3d{-9, -3, 2}));
    EXPECT_EQ(grid->box().hi, (Vec3d{21, 13, 18}));
  }
}

// Files of simulations have a grid of one name for each part.
TEST_F(VolumeFileTest, GridsOfOneNameAreNumbered) {
  const auto one = [](const Voxel&) { return 1.0f; };
  const auto two = [](const Voxel&) { return 2.0f; };
  const std::vector<GridToWrite> grids{
      {.value = one}, {.name = "heat", .value = one}, {.value = two}};
  for (const std::string& bytes : {NvdbFile(grids, NvdbCodec::kNone), VdbFile(grids, {})}) {
    const auto first = Read(bytes);
    ASSERT_TRUE(first.ok()) << first.status();
    EXPECT_EQ(first->info().values.max, 1);
    const auto second = Read(bytes, "density[1]");
    ASSERT_TRUE(second.ok()) << second.status();
    EXPECT_EQ(second->info().values.max, 2);
    EXPECT_THAT(Message(bytes, "density[2]"), HasSubstr("\"density[1]\""));
  }
}

TEST_F(VolumeFileTest, ReadsNvdbOfEveryType) {
  // The error is half a step of the codes over the range of a leaf, which is at most 1 here.
  const struct {
    const char* type;
    float tolerance;
  } cases[] = {{"Fp4", 1.0f / 30}, {"Fp8", 1.0f / 510}, {"Fp16", 1.0f / 131070}, {"FpN", 1e-2f}};
  for (const auto& c : cases) {
    GridToWrite written{.lo = {-9, -3, 2}, .hi = {20, 12, 17}, .value = Lumps};
    written.type = c.type;
    const auto grid = Read(NvdbFile({written}, NvdbCodec::kZip));
    ASSERT_TRUE(grid.ok()) << grid.status();
    ExpectVoxels(*grid, written, c.tolerance * 1.01f);
    EXPECT_GT(grid->info().values.max, 0.9f);
  }
}

TEST_F(VolumeFileTest, ReadsVectors) {
  GridToWrite written{.name = "vel", .hi = {12, 3, 3}, .value = Ramp};
  written.type = "Vec3f";
  for (const std::string& bytes : {NvdbFile({written}, NvdbCodec::kNone), VdbFile({written}, {}),
                                   VdbFile({written}, {.half = true})}) {
    const auto grid = Read(bytes, "vel");
    ASSERT_TRUE(grid.ok()) << grid.status();
    EXPECT_EQ(grid->info().role, VolumeRole::kVelocity);
    VolumeGrid::Cursor cursor(*grid);
    const Vec3f v = grid->VectorAt({11, 2, 1}, &cursor);
    EXPECT_NEAR(v.x, Ramp({11, 2, 1}), 4);
    EXPECT_NEAR(v.y, 2 * v.x, 8);
    EXPECT_NEAR(v.z, 3 * v.x, 16);
    EXPECT_THAT(std::string(grid->CheckDensity("a:1:2").message()), HasSubstr("holds vectors"));
  }
}

TEST_F(VolumeFileTest, TransformsAreAffine) {
  GridToWrite written{.value = Lumps};
  written.voxel_size = 0.25;
  const auto nvdb = Read(NvdbFile({written}, NvdbCodec::kNone));
  const auto vdb = Read(VdbFile({written}, {}));
  ASSERT_TRUE(nvdb.ok() && vdb.ok());
  for (const VolumeGrid* grid : {&*nvdb, &*vdb}) {
    const Vec3d p = TransformPoint(grid->medium_from_index(), {4, 8, 2});
    EXPECT_NEAR(Length(p - Vec3d{1.5, 2.5, 1}), 0, 1e-12);
    EXPECT_NEAR(Length(TransformPoint(grid->index_from_medium(), p) - Vec3d{4, 8, 2}), 0, 1e-12);
  }
  const auto turned = Read(VdbFile({written}, {.has_affine_rotation = true}));
  ASSERT_TRUE(turned.ok()) << turned.status();
  const Vec3d x = TransformVector(turned->medium_from_index(), {1, 0, 0});
  EXPECT_NEAR(Length(x), 0.25, 1e-12);
  EXPECT_NEAR(x.x, 0.25 * std::cos(0.5), 1e-12);
}

TEST_F(VolumeFileTest, ListsGridsByNameAndRole) {
  std::vector<GridToWrite> grids{
      {.value = Lumps}, {.name = "temperature", .value = Ramp}, {.name = "strange", .value = Ramp}};
  grids[2].type = "double";
  GridToWrite points{.name = "strange"};
  points.type = "points";
  for (const std::string& bytes :
       {NvdbFile(grids, NvdbCodec::kBlosc), VdbFile(grids, {.zip = true})}) {
    const auto density = Read(bytes, "density"), temperature = Read(bytes, "temperature");
    ASSERT_TRUE(density.ok() && temperature.ok());
    EXPECT_EQ(density->info().values.max, 15.0f / 16);
    EXPECT_EQ(temperature->info().role, VolumeRole::kTemperature);
    const auto list = ListVolumeFile("smoke.vdb", path_);
    ASSERT_TRUE(list.ok());
    ASSERT_EQ(list->size(), 3u);
    EXPECT_TRUE(list->at(0).can_be_read && list->at(1).can_be_read);
    EXPECT_EQ(list->at(1).role, VolumeRole::kTemperature);
    EXPECT_THAT(Message(bytes, "flame"), HasSubstr("no grid \"flame\"; there are: \"density\" ("));
  }
  for (const std::string& bytes :
       {NvdbFile(grids, NvdbCodec::kBlosc), VdbFile({grids[0], grids[1], points}, {.zip = true})}) {
    ASSERT_TRUE(Read(bytes).ok());
    const auto list = ListVolumeFile("smoke.vdb", path_);
    ASSERT_TRUE(list.ok());
    EXPECT_FALSE(list->at(2).can_be_read);
    EXPECT_THAT(Message(bytes, "strange"), HasSubstr("grid \"strange\""));
    EXPECT_THAT(Message(bytes, "strange"), HasSubstr("convert it"));
  }
}

TEST_F(VolumeFileTest, RefusesInvalidDensities) {
  const auto nan = [](const Voxel& v) {
    return v == Voxel{3, 4, 5} ? std::numeric_limits<float>::quiet_NaN() : 1.0f;
  };
  const auto infinite = [](const Voxel& v) {
    return v == Voxel{3, 4, 5} ? std::numeric_limits<float>::infinity() : 1.0f;
  };
  const auto negative = [](const Voxel& v) { return v == Voxel{3, 4, 5} ? -0.5f : 1.0f; };
  for (const auto& write : {+[](const GridToWrite& g) { return NvdbFile({g}, NvdbCodec::kZip); },
                            +[](const GridToWrite& g) { return VdbFile({g}, {}); }}) {
    EXPECT_THAT(Message(write({.value = nan})), HasSubstr("\"density\" holds NaN or infinity"));
    EXPECT_THAT(Message(write({.value = infinite})), HasSubstr("holds NaN or infinity"));
    const auto grid = Read(write({.value = negative}));
    ASSERT_TRUE(grid.ok());
    EXPECT_THAT(std::string(grid->CheckDensity("a.pbrt:3:1").message()),
                HasSubstr("a.pbrt:3:1: grid \"density\" holds negative densities, down to -0.5"));
  }
}

TEST_F(VolumeFileTest, RefusesOtherFiles) {
  EXPECT_THAT(Message(""), HasSubstr("smoke.vdb: neither a NanoVDB (.nvdb) nor an OpenVDB"));
  EXPECT_THAT(Message("ply\nformat ascii 1.0\n"), HasSubstr("its first bytes match none"));
  std::string old = NvdbFile({{.value = Lumps}}, NvdbCodec::kNone);
  const uint32_t version = 29u << 21;
  std::memcpy(&old[8], &version, sizeof(version));
  EXPECT_THAT(Message(old), HasSubstr("NanoVDB version 29"));
}

TEST_F(VolumeFileTest, EveryTruncationIsAnError) {
  for (const std::string& bytes :
       {NvdbFile({{.value = Lumps}}, NvdbCodec::kNone),
        NvdbFile({{.value = Lumps}}, NvdbCodec::kZip),
        NvdbFile({{.value = Lumps}}, NvdbCodec::kBlosc), VdbFile({{.value = Lumps}}, {}),
        VdbFile({{.value = Lumps}}, {.zip = true})}) {
    for (size_t size = 0; size + 1 < bytes.size(); size += 1 + size / 16) {
      EXPECT_FALSE(Read(bytes.substr(0, size)).ok()) << size << " of " << bytes.size();
    }
  }
}

TEST_F(VolumeFileTest, ErrorsNameLimits) {
  const std::string bytes = NvdbFile({{.value = Lumps}}, NvdbCodec::kZip);
  EXPECT_THAT(Message(bytes, "density", {.grid_bytes_max = 1000}), HasSubstr("grid_bytes_max"));
  EXPECT_THAT(Message(VdbFile({{.value = Lumps}}, {}), "density", {.grid_bytes_max = 1000}),
              HasSubstr("grid_bytes_max"));
  const GridToWrite far{.lo = {2000000000, 0, 0}, .hi = {2000000001, 0, 0}, .value = Lumps};
  EXPECT_THAT(Message(NvdbFile({far}, NvdbCodec::kZip)), HasSubstr("index_abs_max"));
  EXPECT_THAT(Message(VdbFile({far}, {})), HasSubstr("index_abs_max"));
  EXPECT_THAT(Message(bytes, "density", {.grid_count_max = 0}), HasSubstr("grid_count_max"));
}

// A header may claim any size: nothing is allocated that the file could not hold.
TEST_F(VolumeFileTest, DeclaredSizesAreCheckedAgainstTheFile) {
  std::string bytes = NvdbFile({{.value = Lumps}}, NvdbCodec::kZip);
  const uint64_t claimed = uint64_t{8} << 30;
  std::memcpy(&bytes[16], &claimed, sizeof(claimed));
  EXPECT_THAT(Message(bytes), HasSubstr("cut short or damaged"));
}

class VolumeReaderTest : public ::testing::Test {
 protected:
  ~VolumeReaderTest() override {
    ::unlink(path_.c_str());
    ::unlink(page_path_.c_str());
  }
  const std::string path_ = TemporaryPath("volume"), page_path_ = TemporaryPath("pages");
};

TEST_F(VolumeReaderTest, OpensAFileOnce) {
  GridToWrite cloud{.lo = {-8, -9, 3}, .hi = {9, 10, 20}, .value = Lumps}, heat = cloud;
  heat.name = "temperature";
  const std::string nvdb = NvdbFile({cloud, heat}, NvdbCodec::kNone);
  ASSERT_TRUE(WriteFileAtomically(path_, nvdb).ok());
  ASSERT_TRUE(MakePageFile("smoke.nvdb", path_, page_path_).ok());
  for (const std::string& bytes : {nvdb, VdbFile({cloud, heat}, {}), *ReadWholeFile(page_path_)}) {
    ASSERT_TRUE(WriteFileAtomically(path_, bytes).ok());
    const auto expected = ReadVolumeGrid("smoke", path_, "temperature");
    ASSERT_TRUE(expected.ok()) << expected.status();
    VolumeReader reader;
    ASSERT_TRUE(reader.List("smoke", path_).ok());
    ::unlink(path_.c_str());  // The file that is open answers.
    EXPECT_EQ(reader.List("smoke", path_)->size(), 2u);
    for (int i = 0; i < 2; ++i) {
      const auto grid = reader.Read("smoke", path_, "temperature");
      ASSERT_TRUE(grid.ok()) << grid.status();
      EXPECT_EQ(grid->info().active_voxel_count, expected->info().active_voxel_count);
      EXPECT_EQ(grid->MeanValue(), expected->MeanValue());
      EXPECT_TRUE(reader.Read("smoke", path_, "density").ok());
      EXPECT_THAT(std::string(reader.Read("smoke", path_, "fog").status().message()),
                  HasSubstr("smoke: no grid \"fog\"; there are: \"density\" ("));
    }
    EXPECT_EQ(reader.open_count(), 1u);
  }
}

TEST_F(VolumeReaderTest, RemembersFilesThatCannotBeRead) {
  VolumeReader reader;
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(reader.List("smoke", path_).status().code(), absl::StatusCode::kNotFound);
    EXPECT_EQ(reader.Read("smoke", path_, "fog").status().code(), absl::StatusCode::kNotFound);
  }
  EXPECT_EQ(reader.open_count(), 1u);
}

}  // namespace
}  // namespace sheaf
