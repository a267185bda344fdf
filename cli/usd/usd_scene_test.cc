// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/usd/usd_scene.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <tuple>

#include "absl/status/status.h"

namespace sheaf::cli {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

constexpr char kTriangle[] = R"(#usda 1.0
(
    metersPerUnit = 1
)
def Mesh "Triangle"
{
    int[] faceVertexCounts = [3]
    int[] faceVertexIndices = [0, 1, 2]
    point3f[] points = [(0, 0, 0), (1, 0, 0), (0, 1, 0)]
    uniform token subdivisionScheme = "none"
}
)";

class UsdSceneTest : public ::testing::Test {
 protected:
  void SetUp() override {
    folder_ = ::testing::TempDir() + "/usd_scene_" + std::to_string(::getpid());
    std::filesystem::create_directories(folder_ + "/scene");
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string Write(const std::string& name, const std::string& bytes) const {
    std::ofstream(folder_ + "/" + name, std::ios::binary) << bytes;
    return folder_ + "/" + name;
  }
  std::string folder_;
};

TEST_F(UsdSceneTest, NamesAreKnownByTheirEndings) {
  EXPECT_TRUE(IsUsdName("a/Toy.USDZ"));
  EXPECT_TRUE(IsUsdName("shot.usd"));
  EXPECT_FALSE(IsUsdName("toy.glb"));
  EXPECT_EQ(NameAsRead("toy.usdz"), "toy.usdz.glb");
  EXPECT_EQ(NameAsRead("toy.pbrt"), "toy.pbrt");
}

TEST_F(UsdSceneTest, AFileBecomesGltf) {
  const absl::StatusOr<UsdScene> scene = ConvertUsd(Write("scene/toy.usda", kTriangle));
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_THAT(scene->glb, StartsWith("glTF"));
  EXPECT_THAT(scene->glb, HasSubstr("\"name\":\"Triangle\""));
  EXPECT_THAT(scene->notes, ElementsAre());
}

TEST_F(UsdSceneTest, WhatIsLeftOutIsNoted) {
  const std::string path =
      Write("scene/toy.usda", std::string(kTriangle) + "def NurbsPatch \"Patch\"\n{\n}\n");
  const absl::StatusOr<UsdScene> scene = ConvertUsd(path);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_THAT(scene->notes, ElementsAre("prims of the type NurbsPatch are left out (/Patch)"));
}

TEST_F(UsdSceneTest, FilesOutsideOfTheFolderAreNotReached) {
  Write("outside.usda", kTriangle);
  const std::string path = Write(
      "scene/toy.usda",
      std::string(kTriangle) + "def \"Other\" (references = @../outside.usda@</Triangle>)\n{\n}\n");
  std::filesystem::create_symlink("../outside.usda", folder_ + "/scene/link.usda");
  const absl::StatusOr<UsdScene> scene = ConvertUsd(path);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_THAT(scene->notes, ElementsAre(HasSubstr("/Other: ../outside.usda")));
  const absl::StatusOr<UsdScene> linked = ConvertUsd(Write(
      "scene/linked.usda",
      std::string(kTriangle) + "def \"Other\" (references = @link.usda@</Triangle>)\n{\n}\n"));
  ASSERT_TRUE(linked.ok()) << linked.status();
  EXPECT_THAT(linked->notes, ElementsAre(HasSubstr("/Other: link.usda")));
}

TEST_F(UsdSceneTest, BrokenFilesAreRefusedInOneLine) {
  for (const auto& [name, bytes, reason] :
       {std::tuple{"a.usda", std::string("#usda 1.0\ndef Mesh \"A\" {\n  int x = [1, \n"),
                   "line 4: "},
        std::tuple{"a.usdc", std::string("PXR-USDC\0\x08\0\0", 12), "cut off or broken"},
        std::tuple{"a.usdz", std::string("PK\x03\x04 only"), "no zip file"},
        std::tuple{"a.usd", std::string("solid cube"), "is no USD"},
        std::tuple{"b.usda", std::string("#usda 1.0\n"), "nothing that is shown"}}) {
    const absl::StatusOr<UsdScene> scene = ConvertUsd(Write(std::string("scene/") + name, bytes));
    EXPECT_TRUE(absl::IsInvalidArgument(scene.status())) << scene.status();
    EXPECT_THAT(std::string(scene.status().message()), HasSubstr(reason));
    EXPECT_THAT(std::string(scene.status().message()), StartsWith(folder_));
    EXPECT_EQ(scene.status().message().find('\n'), std::string::npos);
  }
}

TEST_F(UsdSceneTest, HugeScenesAreRefusedInOneLine) {
  std::string text =
      "#usda 1.0\ndef PointInstancer \"Many\"\n{\n  rel prototypes = [</Many/A>]\n"
      "  point3f[] positions = [(0, 0, 0)]\n  int[] protoIndices = [0";
  for (int i = 0; i < 1'000'000; ++i) text += ",0";
  text += "]\n  def Sphere \"A\"\n  {\n  }\n}\n";
  const absl::StatusOr<UsdScene> scene = ConvertUsd(Write("scene/huge.usda", text));
  ASSERT_FALSE(scene.ok());
  EXPECT_THAT(std::string(scene.status().message()), HasSubstr("more than 1000000 instances"));
  EXPECT_EQ(scene.status().message().find('\n'), std::string::npos);
}

TEST_F(UsdSceneTest, CirclesOfReferencesAreRefusedInOneLine) {
  const absl::StatusOr<UsdScene> scene =
      ConvertUsd(Write("scene/circle.usda",
                       "#usda 1.0\ndef \"A\" (references = </B>)\n{\n}\n"
                       "def \"B\" (references = </A>)\n{\n}\n"));
  ASSERT_FALSE(scene.ok());
  EXPECT_THAT(std::string(scene.status().message()), HasSubstr("form a circle"));
}

TEST_F(UsdSceneTest, WithoutNodeTheErrorSaysWhatToInstall) {
  const std::string path = Write("scene/toy.usda", kTriangle);
  const std::string before = std::getenv("PATH");
  ::setenv("PATH", folder_.c_str(), 1);
  const absl::StatusOr<UsdScene> scene = ConvertUsd(path);
  ::setenv("PATH", before.c_str(), 1);
  EXPECT_TRUE(absl::IsFailedPrecondition(scene.status())) << scene.status();
  EXPECT_THAT(std::string(scene.status().message()), HasSubstr("apt-get install nodejs"));
  EXPECT_THAT(std::string(scene.status().message()), HasSubstr("in Blender by File > Export"));
}

}  // namespace
}  // namespace sheaf::cli
