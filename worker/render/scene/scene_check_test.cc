// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/scene_check.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>

#include "common/scene/pbrt/scene_reader.h"
#include "worker/render/scene/compile_scene.h"

namespace sheaf::render {
namespace {

using ::testing::HasSubstr;

constexpr char kFrame[] =
    "Camera \"perspective\"\nFilm \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8\n"
    "WorldBegin\nLightSource \"infinite\"\n";

// CheckScene and CompileScene agree about a scene of these lines, which begin in line 5.
void ExpectBothSay(const std::string& world, const std::string& text) {
  const std::string folder = ::testing::TempDir();
  std::ofstream(folder + "/checked.pbrt") << kFrame << world;
  DirectoryFileSource files(folder);
  const absl::StatusOr<ReadSceneResult> read = ReadScene("checked.pbrt", files);
  ASSERT_TRUE(read.ok()) << read.status();
  const absl::StatusOr<FrameSettings> settings = ResolveSettings(read->scene, {});
  ASSERT_TRUE(settings.ok()) << settings.status();
  const absl::Status checked = CheckScene(read->scene, *settings, files);
  const absl::Status compiled = CompileScene(read->scene, *settings, files).status();
  EXPECT_EQ(checked, compiled) << world;
  EXPECT_THAT(std::string(checked.message()), HasSubstr(text));
}

TEST(SceneCheckTest, FindsWhatCompilingFinds) {
  ExpectBothSay("Shape \"sphere\"\n", "");
  ExpectBothSay(
      "AreaLightSource \"diffuse\"\n"
      "Shape \"bilinearmesh\" \"point3 P\" [-1 -1 0 1 -1 .5 -1 1 .5 1 1 0]\n",
      "checked.pbrt:6:1: Shape \"bilinearmesh\": as an area light its patches must be");
  ExpectBothSay(
      "Material \"dielectric\" \"integer priority\" 1\n"
      "Shape \"curve\" \"point3 P\" [0 0 0 0 1 0 0 2 0 0 3 0] \"float width\" .1\n",
      "checked.pbrt:6:1: curves have no inside");
  ExpectBothSay("AreaLightSource \"diffuse\" \"rgb L\" [1e30 1 1]\nShape \"sphere\"\n",
                "checked.pbrt:5:1: the light's radiance of ");
}

}  // namespace
}  // namespace sheaf::render
