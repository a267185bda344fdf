// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/dropped/scene_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "common/base/file.h"
#include "tests/support/temporary_path.h"

namespace sheaf::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class SceneChoiceTest : public ::testing::Test {
 protected:
  SceneChoiceTest() { std::filesystem::create_directories(folder_); }
  ~SceneChoiceTest() override { std::filesystem::remove_all(folder_); }
  void Put(const std::string& name, const std::string& text = "x") {
    const std::filesystem::path path = std::filesystem::path(folder_) / name;
    std::filesystem::create_directories(path.parent_path());
    ASSERT_TRUE(WriteFileOnce(path.string(), text).ok());
  }
  SceneChoice Find(const std::string& wanted = "") {
    const absl::StatusOr<SceneChoice> choice = FindScene(folder_, wanted);
    EXPECT_TRUE(choice.ok()) << choice.status();
    return choice.value_or(SceneChoice());
  }
  std::string Error(const std::string& wanted = "") {
    return std::string(FindScene(folder_, wanted).status().message());
  }
  const std::string folder_ = sheaf::testing::TemporaryPath("choice");
};

TEST_F(SceneChoiceTest, TheOnlySceneAtTheTopIsMeant) {
  Put("room.pbrt");
  Put("geometry/part.pbrt");
  Put("wood.png");
  EXPECT_THAT(Find().path, EndsWith("/room.pbrt"));
}

TEST_F(SceneChoiceTest, AFolderThatWasDroppedAsAWholeIsTheTop) {
  Put("shot/v2/robot.GLB");
  Put("shot/v2/textures/metal.png");
  EXPECT_THAT(Find().path, EndsWith("/shot/v2/robot.GLB"));
  EXPECT_THAT(Find("robot.GLB").path, EndsWith("/shot/v2/robot.GLB"));
}

TEST_F(SceneChoiceTest, SeveralScenesAreListed) {
  Put("b.pbrt");
  Put("a.gltf");
  Put("deeper/c.pbrt");
  EXPECT_THAT(Find().path, IsEmpty());
  EXPECT_THAT(Find().scenes, ElementsAre("a.gltf", "b.pbrt"));
  EXPECT_THAT(Find("b.pbrt").path, EndsWith("/b.pbrt"));
  EXPECT_THAT(Find("deeper/c.pbrt").path, EndsWith("/deeper/c.pbrt"));
}

TEST_F(SceneChoiceTest, WithoutASceneAtTheTopThoseBelowCount) {
  Put("readme.txt");
  Put("x/a.pbrt");
  EXPECT_THAT(Find().path, EndsWith("/x/a.pbrt"));
  Put("y/b.pbrt");
  EXPECT_THAT(Find().scenes, ElementsAre("x/a.pbrt", "y/b.pbrt"));
}

TEST_F(SceneChoiceTest, WhatIsNotThereIsSaid) {
  Put("notes.txt");
  Put("more.txt");
  EXPECT_THAT(Error(), HasSubstr("no scene is among the dropped files"));
  EXPECT_THAT(Error("room.pbrt"), HasSubstr("room.pbrt is not among the dropped files"));
  EXPECT_THAT(Error("../room.pbrt"), HasSubstr("is refused"));
}

TEST_F(SceneChoiceTest, AFileOfAnotherProgramIsNamed) {
  Put("room.blend", "BLENDER-v300");
  EXPECT_THAT(Error(), HasSubstr("Blender"));
}

TEST_F(SceneChoiceTest, LinksAreNoScenes) {
  std::filesystem::create_symlink("/etc/hostname", folder_ + "/room.pbrt");
  Put("a.txt");
  EXPECT_THAT(Error(), HasSubstr("no scene"));
  EXPECT_THAT(Error("room.pbrt"), HasSubstr("not among the dropped files"));
}

}  // namespace
}  // namespace sheaf::cli
