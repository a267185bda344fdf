// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the outputs that a scene file requests besides its image.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "common/scene/file_source.h"
#include "common/scene/pbrt/scene_reader.h"
#include "common/scene/settings/render_settings.h"
#include "tests/support/temporary_path.h"

namespace sheaf {
namespace {

absl::StatusOr<ReadSceneResult> Read(const std::string& text) {
  const std::string directory = testing::TemporaryPath("scene");
  std::filesystem::create_directories(directory);
  std::ofstream(directory + "/main.pbrt") << text;
  DirectoryFileSource files(directory);
  return ReadScene("main.pbrt", files);
}

std::string OutputsOf(const std::string& film) {
  const absl::StatusOr<ReadSceneResult> result = Read(film + "\nWorldBegin\n");
  EXPECT_TRUE(result.ok()) << result.status();
  return result.ok() ? FormatOutputs(result->scene.film.outputs) : "";
}

TEST(SceneOutputsTest, GeometryBufferRequestsOutputs) {
  EXPECT_EQ(OutputsOf("Film \"rgb\""), "");
  EXPECT_EQ(OutputsOf("Film \"gbuffer\""),
            "position,normal-geometric,normal-shading,uv,space:camera");
  EXPECT_EQ(OutputsOf("Film \"gbuffer\" \"string coordinatesystem\" \"world\""),
            "position,normal-geometric,normal-shading,uv");
  EXPECT_FALSE(Read("Film \"gbuffer\" \"string coordinatesystem\" \"here\"\nWorldBegin\n").ok());
}

// The color space in effect at Film counts, not the one after it.
TEST(SceneOutputsTest, ImagePrimariesComeFromTheFilm) {
  const auto result = Read(
      "ColorSpace \"aces2065-1\"\nFilm \"rgb\" \"float whitebalance\" 5000\nColorSpace \"srgb\"\n"
      "WorldBegin\n");
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(result->diagnostics.empty());
  EXPECT_EQ(result->scene.film.primaries, Primaries::kAces2065);
  EXPECT_EQ(ResolveSettings(result->scene, {})->primaries, Primaries::kAces2065);
  EXPECT_EQ(ResolveSettings(result->scene, {})->white_balance_k, 5000);
  RenderSettings asked;
  asked.primaries = Primaries::kSrgb;
  EXPECT_EQ(ResolveSettings(result->scene, asked)->primaries, Primaries::kSrgb);
  EXPECT_EQ(Read("Film \"rgb\"\nWorldBegin\n")->scene.film.primaries, Primaries::kSrgb);
}

TEST(SceneOutputsTest, ImpossibleWhiteBalancesAreRefused) {
  for (const char* temperature : {"-5000", "999", "25001"}) {
    const auto result =
        Read(std::string("Film \"rgb\" \"float whitebalance\" ") + temperature + "\nWorldBegin\n");
    ASSERT_FALSE(result.ok());
    EXPECT_NE(std::string(result.status().message()).find("main.pbrt:1:"), std::string::npos)
        << result.status();
  }
}

TEST(SceneOutputsTest, LightsHaveLightGroups) {
  const absl::StatusOr<ReadSceneResult> result = Read(
      "WorldBegin\nLightSource \"point\" \"string lightgroup\" \"key\"\n"
      "LightSource \"infinite\"\n"
      "AreaLightSource \"diffuse\" \"string lightgroup\" \"Panel-2\"\nShape \"sphere\"\n");
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->scene.lights[0].group, "key");
  EXPECT_EQ(result->scene.lights[1].group, "default");
  EXPECT_EQ(result->scene.area_lights[0].group, "Panel-2");
}

TEST(SceneOutputsTest, ThingsHaveNamesForMattes) {
  const absl::StatusOr<ReadSceneResult> result = Read(
      "WorldBegin\nMaterial \"diffuse\" \"string name\" \"wood\"\n"
      "Shape \"sphere\" \"string name\" \"Ball\"\nShape \"disk\"\n"
      "AttributeBegin\nAttribute \"shape\" \"string name\" \"Ball\"\nShape \"sphere\"\n"
      "AttributeEnd\nObjectBegin \"o\"\nShape \"sphere\"\nObjectEnd\n"
      "ObjectInstance \"o\" \"string name\" \"Oak\"\nObjectInstance \"o\"\n");
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_TRUE(result->diagnostics.empty());
  const SceneDescription& scene = result->scene;
  EXPECT_EQ(scene.matte_names, (std::vector<std::string>{"Ball", "Oak"}));
  const std::vector<int32_t> of_shapes{0, kNone, 0, kNone};
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(scene.shapes[i].matte_name, of_shapes[i]) << i;
  EXPECT_EQ(scene.instances[0].matte_name, 1);
  EXPECT_EQ(scene.instances[1].matte_name, kNone);
  EXPECT_EQ(scene.materials[static_cast<size_t>(scene.shapes[0].material)].name, "wood");
}

TEST(SceneOutputsTest, NamesForMattesArePrintable) {
  EXPECT_FALSE(Read("WorldBegin\nShape \"sphere\" \"string name\" \"\x07\"\n").ok());
  EXPECT_FALSE(
      Read("WorldBegin\nShape \"sphere\" \"string name\" \"" + std::string(256, 'a') + "\"\n")
          .ok());
  EXPECT_FALSE(Read("WorldBegin\nObjectBegin \"o\"\nObjectEnd\n"
                    "ObjectInstance \"o\" \"string nam\" \"Oak\"\n")
                   .ok());
  const auto of_object = Read(
      "WorldBegin\nObjectBegin \"o\"\nShape \"sphere\" \"string name\" \"Ball\"\nObjectEnd\n"
      "ObjectInstance \"o\"\n");
  ASSERT_TRUE(of_object.ok()) << of_object.status();
  EXPECT_EQ(of_object->diagnostics.size(), 1u);
  EXPECT_EQ(of_object->scene.shapes[0].matte_name, kNone);
}

// Curves of one name become one shape, those of two do not.
TEST(SceneOutputsTest, CurvesOfOtherNamesStayApart) {
  const auto curve = [](const std::string& name) {
    return "Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0] \"string name\" \"" + name +
           "\"\n";
  };
  const auto result = Read("WorldBegin\n" + curve("a") + curve("a") + curve("b"));
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->scene.shapes.size(), 2u);
}

}  // namespace
}  // namespace sheaf
