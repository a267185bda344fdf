// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/grid_files.h"

#include <filesystem>
#include <optional>
#include <string>

#include "common/base/file.h"
#include "common/scene/file_source.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"
#include "tests/support/temporary_path.h"
#include "tests/support/volume/volume_writers.h"

namespace sheaf::render {
namespace {

using ::sheaf::testing::NvdbCodec;
using ::sheaf::testing::NvdbFile;
using ::testing::HasSubstr;

TEST(GridFilesTest, ReadsEachGridOnceAndCountsItOnce) {
  const std::string path = sheaf::testing::TemporaryPath("smoke");
  const auto value = [](const sheaf::testing::Voxel& v) { return static_cast<float>(v[0]); };
  ASSERT_TRUE(WriteFileAtomically(path, NvdbFile({{.name = "density", .value = value},
                                                  {.name = "b", .value = value}},
                                                 NvdbCodec::kNone))
                  .ok());
  TableFileSource files{{{"smoke.nvdb", path}}};
  std::optional<GridFiles> grids;
  grids.emplace(&files, 1);
  EXPECT_EQ(grids->List("m", "smoke.nvdb")->size(), 2u);
  auto first = grids->Read("m", "smoke.nvdb", "density");
  ASSERT_TRUE(first.ok()) << first.status();
  // The grid that was read no longer needs the file; the other does.
  std::filesystem::remove(path);
  auto second = grids->Read("m", "smoke.nvdb", "density");
  ASSERT_TRUE(second.ok()) << second.status();
  EXPECT_THAT(std::string(grids->Read("m", "smoke.nvdb", "b").status().message()),
              HasSubstr("m: smoke.nvdb"));
  grids.reset();
  EXPECT_EQ(first->memory_bytes(), first->info().memory_bytes / 2);
  EXPECT_EQ(first->memory_bytes(), second->memory_bytes());
  // The boxes are those of each copy.
  const IndexBox whole = first->box();
  second->set_box({{1, 1, 1}, {2, 2, 2}});
  EXPECT_EQ(first->box().hi.x, whole.hi.x);
  VolumeGrid::Cursor a(*first), b(*second);
  EXPECT_EQ(first->At({3, 2, 2}, &a), 3.0f);
  EXPECT_EQ(second->At({3, 2, 2}, &b), 3.0f);
}

}  // namespace
}  // namespace sheaf::render
