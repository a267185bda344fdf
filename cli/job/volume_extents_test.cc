// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/volume_extents.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "common/base/file.h"
#include "common/scene/pbrt/scene_reader.h"
#include "tests/support/temporary_path.h"
#include "tests/support/volume/volume_writers.h"

namespace sheaf::cli {
namespace {

using ::sheaf::testing::NvdbCodec;
using ::sheaf::testing::NvdbFile;
using ::sheaf::testing::Voxel;
using ::testing::HasSubstr;

TEST(VolumeExtentsTest, GridsAreWhereTheMediumIs) {
  const std::string scene_path = sheaf::testing::TemporaryPath("scene"),
                    volume_path = sheaf::testing::TemporaryPath("smoke");
  const auto one = [](const Voxel&) { return 1.0f; };
  ASSERT_TRUE(WriteFileAtomically(
                  volume_path,
                  NvdbFile({{.lo = {-3, 0, 1}, .hi = {4, 1, 2}, .value = one, .voxel_size = 0.5}},
                           NvdbCodec::kNone))
                  .ok());
  ASSERT_TRUE(
      WriteFileAtomically(
          scene_path,
          "WorldBegin\nAttributeBegin\nTranslate 10 0 0\nScale 2 1 1\n"
          "MakeNamedMedium \"m\" \"string type\" \"nanovdb\" \"string filename\" "
          "\"smoke.nvdb\"\nAttributeEnd\nMediumInterface \"m\" \"\"\nMaterial \"interface\"\n"
          "Shape \"sphere\" \"float radius\" 50\n")
          .ok());
  TableFileSource files{{{"room.pbrt", scene_path}, {"smoke.nvdb", volume_path}}};
  const auto read = ReadScene("room.pbrt", files);
  ASSERT_TRUE(read.ok()) << read.status();
  VolumeReader reader;
  const std::vector<VolumeExtent> extents = VolumeExtents(read->scene, files, &reader);
  ASSERT_EQ(extents.size(), 1u);
  EXPECT_EQ(extents[0].active_voxel_count, 8u * 2 * 2);
  // From voxel -3 to one past voxel 4, at half a unit each beside the writer's offset of .5, twice
  // as wide along x.
  EXPECT_DOUBLE_EQ(extents[0].lo.x, 10 - 2);
  EXPECT_DOUBLE_EQ(extents[0].hi.x, 10 + 6);
  EXPECT_DOUBLE_EQ(extents[0].lo.z, 1);
  EXPECT_DOUBLE_EQ(extents[0].hi.z, 2);
  EXPECT_EQ(FormatVolumeExtent(extents[0]),
            "medium \"m\": smoke.nvdb, grid \"density\": 32 voxels in the box from (8, 0.5, 1) to "
            "(16, 1.5, 2)");
}

TEST(VolumeExtentsTest, AnEmptyGridHasNoBox) {
  EXPECT_THAT(FormatVolumeExtent({"m", "a.vdb", "density", {1, 1, 1}, {0, 0, 0}}),
              HasSubstr("no active voxels"));
}

}  // namespace
}  // namespace sheaf::cli
