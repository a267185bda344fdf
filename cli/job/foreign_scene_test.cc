// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/foreign_scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

namespace sheaf::cli {
namespace {

using ::testing::HasSubstr;

std::string Refusal(const std::string& path, const std::string& head) {
  const absl::Status status = CheckSceneFormat(path, head);
  EXPECT_TRUE(status.ok() || absl::IsInvalidArgument(status));
  return std::string(status.message());
}

TEST(ForeignSceneTest, FormatsAreRecognizedByTheirFirstBytes) {
  EXPECT_THAT(Refusal("x", "BLENDER-v305"),
              HasSubstr("x: is a Blender file, not a pbrt-v4 or glTF scene"));
  EXPECT_THAT(Refusal("x", "BLENDER-v305"), HasSubstr("export it as glTF"));
  EXPECT_THAT(Refusal("x", "glTF\x02"), HasSubstr("a glTF file"));
  EXPECT_THAT(Refusal("x", "\n{ \"asset\": {\"version\": \"2.0\"}}"),
              HasSubstr("name it .gltf or .glb"));
  EXPECT_THAT(Refusal("x", "PXR-USDC"),
              HasSubstr("a USD file, not a pbrt-v4 or glTF scene; name it"));
  EXPECT_THAT(Refusal("x", "#usda 1.0\n"), HasSubstr("a USD file"));
  EXPECT_THAT(Refusal("x", "<?xml version=\"1.0\"?>\n<scene version=\"3.0.0\">"),
              HasSubstr("a Mitsuba scene"));
  EXPECT_THAT(Refusal("x", "Ogawa\xff"), HasSubstr("an Alembic file"));
  EXPECT_THAT(Refusal("x", "\x89PNG\r\n"), HasSubstr("give the scene that uses it"));
  EXPECT_THAT(Refusal("x", std::string("Film\0\x1b", 6)), HasSubstr("a binary file"));
}

TEST(ForeignSceneTest, CompressedFormatsAreRecognizedByName) {
  EXPECT_THAT(Refusal("room.blend", "\x28\xb5\x2f\xfd"), HasSubstr("a Blender file"));
}

TEST(ForeignSceneTest, UsdIsAccepted) {
  EXPECT_EQ(Refusal("Room.USDZ", "PK\x03\x04"), "");
  EXPECT_EQ(Refusal("room.usdc", "PXR-USDC"), "");
}

TEST(ForeignSceneTest, PbrtScenesAreAccepted) {
  for (const char* head : {"", "# a comment with < and {\nFilm", "LookAt 0 0 1", "Film \"rgb\"",
                           "\xc3\xa9", "glossy"}) {
    EXPECT_EQ(Refusal("room.pbrt", head), "") << head;
  }
  EXPECT_TRUE(CheckSceneFormatOf("/nowhere/room.pbrt").ok()) << "the reader says it";
}

TEST(ForeignSceneTest, ReadsTheFileHead) {
  const std::string path = ::testing::TempDir() + "/sheaf_foreign_scene";
  std::ofstream(path) << "BLENDER-v305\x1b[31m";
  EXPECT_TRUE(absl::IsInvalidArgument(CheckSceneFormatOf(path)));
}

}  // namespace
}  // namespace sheaf::cli
