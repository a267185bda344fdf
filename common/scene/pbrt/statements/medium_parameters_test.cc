// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the results of MakeNamedMedium and MediumInterface.
#include "common/scene/pbrt/statements/medium_parameters.h"

#include <string>

#include "common/base/file.h"
#include "common/scene/pbrt/scene_reader.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

class MediumReaderTest : public ::testing::Test {
 protected:
  absl::StatusOr<ReadSceneResult> Read(const std::string& text) {
    const auto* info = ::testing::UnitTest::GetInstance()->current_test_info();
    const std::string folder = ::testing::TempDir() + "sheaf-media-" + info->name();
    EXPECT_TRUE(MakeDirectories(folder).ok());
    for (const char* name : {"smoke.nvdb", "fire.VDB"}) Write(folder + "/" + name, "x");
    Write(folder + "/main.pbrt", text);
    DirectoryFileSource files(folder);
    return ReadScene("main.pbrt", files);
  }
  SceneDescription ReadGood(const std::string& text) {
    absl::StatusOr<ReadSceneResult> result = Read(text);
    EXPECT_TRUE(result.ok()) << result.status().message();
    if (!result.ok()) return {};
    for (const SceneDiagnostic& note : result->diagnostics) notes_ += note.text + "\n";
    return std::move(result->scene);
  }
  static void Write(const std::string& path, const std::string& text) {
    EXPECT_TRUE(WriteFileAtomically(path, text).ok());
  }
  std::string notes_;
};

TEST_F(MediumReaderTest, DefaultsMatchPbrt) {
  const SceneDescription scene = ReadGood(
      "MakeNamedMedium \"m\" \"string type\" \"homogeneous\"\nMediumInterface \"\" \"m\"\n"
      "Camera \"perspective\"\nWorldBegin\n");
  ASSERT_EQ(scene.media.size(), 1u);
  const MediumDescription& medium = scene.media[0];
  EXPECT_TRUE(medium.IsHomogeneous());
  EXPECT_EQ(medium.sigma_a.rgb, Rgb::Gray(1));
  EXPECT_EQ(medium.sigma_s.rgb, Rgb::Gray(1));
  EXPECT_EQ(medium.scale, 1);
  EXPECT_EQ(medium.g, 0);
  EXPECT_FALSE(medium.emits);
  EXPECT_EQ(medium.radiance_scale, 1);
  EXPECT_EQ(scene.camera.medium, 0);
}

TEST_F(MediumReaderTest, CameraIsInTheCurrentOutsideMedium) {
  const SceneDescription scene = ReadGood(
      "Camera \"perspective\"\nMediumInterface \"a\" \"b\"\nWorldBegin\n"
      "MakeNamedMedium \"a\" \"string type\" \"homogeneous\"\n"
      "MakeNamedMedium \"b\" \"string type\" \"homogeneous\"\n"
      "Shape \"sphere\"\nAttributeBegin\nMediumInterface \"\"\nShape \"sphere\"\nAttributeEnd\n"
      "MediumInterface \"b\"\nShape \"sphere\"\n"
      "Shape \"curve\" \"point3 P\" [0 0 0 1 0 0 2 0 0 3 0 0]\n");
  EXPECT_EQ(scene.camera.medium, kNone);
  ASSERT_EQ(scene.shapes.size(), 4u);
  EXPECT_EQ(scene.media[0].name, "a");
  EXPECT_EQ(scene.shapes[0].media.inside, 0);
  EXPECT_EQ(scene.shapes[0].media.outside, 1);
  EXPECT_FALSE(scene.shapes[1].media.Separates());
  EXPECT_FALSE(scene.shapes[2].media.Separates());  // The same on both sides.
  EXPECT_FALSE(scene.shapes[3].media.Separates());
}

TEST_F(MediumReaderTest, ReadsEveryParameter) {
  const SceneDescription scene = ReadGood(
      "WorldBegin\nTranslate 1 2 3\nMakeNamedMedium \"m\" \"string type\" \"homogeneous\"\n"
      "\"rgb sigma_a\" [1 2 3] \"rgb sigma_s\" [4 5 6] \"float scale\" 2 \"float g\" -0.5\n"
      "\"rgb Le\" [7 8 9] \"float Lescale\" 10\n"
      "MakeNamedMedium \"p\" \"string type\" \"homogeneous\" \"string preset\" \"Ketchup\"\n"
      "MediumInterface \"m\" \"p\"\n");
  const MediumDescription& medium = scene.media[0];
  EXPECT_EQ(medium.sigma_a.rgb, (Rgb{1, 2, 3}));
  EXPECT_EQ(medium.sigma_s.rgb, (Rgb{4, 5, 6}));
  EXPECT_EQ(medium.scale, 2);
  EXPECT_EQ(medium.g, -0.5f);
  EXPECT_TRUE(medium.emits);
  EXPECT_EQ(medium.radiance.rgb, (Rgb{7, 8, 9}));
  EXPECT_EQ(medium.radiance_scale, 10);
  EXPECT_EQ(medium.world_from_medium.m[1][3], 2);
  EXPECT_EQ(scene.media[1].sigma_s.rgb, (Rgb{0.18f, 0.07f, 0.03f}));
  EXPECT_EQ(scene.media[1].sigma_a.rgb, (Rgb{0.061f, 0.97f, 1.45f}));
}

TEST_F(MediumReaderTest, ReadsGridsCloudsAndFiles) {
  const SceneDescription scene = ReadGood(
      "WorldBegin\nMakeNamedMedium \"u\" \"string type\" \"uniformgrid\" \"integer nx\" 2\n"
      "\"float density\" [0 0.5] \"point3 p0\" [1 1 1] \"point3 p1\" [-1 0 3]\n"
      "\"float temperature\" [900 1000] \"float temperatureoffset\" 5\n"
      "MakeNamedMedium \"r\" \"string type\" \"rgbgrid\" \"integer ny\" 2\n"
      "\"rgb sigma_s\" [1 2 3 4 5 6]\n"
      "MakeNamedMedium \"c\" \"string type\" \"cloud\" \"float density\" 2 \"float wispiness\" 3\n"
      "MakeNamedMedium \"n\" \"string type\" \"nanovdb\" \"string filename\" \"smoke.nvdb\"\n"
      "MakeNamedMedium \"v\" \"string type\" \"nanovdb\" \"string filename\" \"fire.VDB\"\n"
      "MediumInterface \"u\" \"r\" MediumInterface \"c\" \"n\" MediumInterface \"v\" \"\"\n");
  ASSERT_EQ(scene.media.size(), 5u);
  const auto& grid = std::get<UniformGridMedium>(scene.media[0].kind);
  EXPECT_EQ(grid.density, (std::vector<float>{0, 0.5f}));
  EXPECT_EQ(grid.box.p0, (Vec3d{-1, 0, 1}));
  EXPECT_EQ(grid.box.p1, (Vec3d{1, 1, 3}));
  EXPECT_EQ(grid.temperature_k[1], 1000);
  EXPECT_EQ(grid.emission.offset_k, 5);
  EXPECT_TRUE(scene.media[0].emits);
  const auto& colors = std::get<RgbGridMedium>(scene.media[1].kind);
  EXPECT_TRUE(colors.sigma_a.empty());
  EXPECT_EQ(colors.sigma_s[1], (Rgb{4, 5, 6}));
  EXPECT_EQ(std::get<CloudMedium>(scene.media[2].kind).wispiness, 3);
  EXPECT_FALSE(std::get<VolumeFileMedium>(scene.media[3].kind).is_openvdb);
  EXPECT_TRUE(std::get<VolumeFileMedium>(scene.media[4].kind).is_openvdb);
}

TEST_F(MediumReaderTest, GridsWithoutEffectAreReportedAndIgnored) {
  const SceneDescription scene = ReadGood(
      "WorldBegin\nMakeNamedMedium \"u\" \"string type\" \"uniformgrid\" \"integer nx\" 2\n"
      "\"float density\" [0 0] \"rgb Le\" [1 1 1]\n"
      "MakeNamedMedium \"r\" \"string type\" \"rgbgrid\" \"integer nx\" 2\n"
      "\"rgb sigma_s\" [0 0 0 0 0 0] \"rgb sigma_a\" [0 0 0 0 0 0]\n"
      "MakeNamedMedium \"cold\" \"string type\" \"uniformgrid\" \"float density\" 1\n"
      "\"float temperature\" 120 \"float temperatureoffset\" 21\n"
      "MediumInterface \"u\" \"r\" MediumInterface \"cold\" \"\"\n");
  ASSERT_EQ(scene.media.size(), 3u);
  for (size_t i = 0; i < 2; ++i) {
    EXPECT_TRUE(scene.media[i].IsHomogeneous());
    EXPECT_TRUE(scene.media[i].sigma_s.rgb.IsBlack() && scene.media[i].sigma_a.rgb.IsBlack());
  }
  EXPECT_FALSE(scene.media[2].IsHomogeneous());
  for (const MediumDescription& medium : scene.media) EXPECT_FALSE(medium.emits);
  EXPECT_NE(notes_.find("medium \"u\" has no effect: its grid is 0 in all cells"),
            std::string::npos);
  EXPECT_NE(notes_.find("medium \"r\" has no effect"), std::string::npos);
  EXPECT_NE(notes_.find("\"temperature\" has no effect: no cell is hotter than 100 K"),
            std::string::npos);
}

TEST_F(MediumReaderTest, VelocitiesAreReadOnRequest) {
  const SceneDescription scene = ReadGood(
      "WorldBegin\nMakeNamedMedium \"u\" \"string type\" \"uniformgrid\" \"integer nx\" 2\n"
      "\"float density\" [0 1] \"vector3 velocity\" [1 2 3 4 5 6] \"float velocityscale\" -2\n"
      "MakeNamedMedium \"n\" \"string type\" \"nanovdb\" \"string filename\" \"smoke.nvdb\"\n"
      "\"string velocity\" \"vel\"\n"
      "MakeNamedMedium \"v\" \"string type\" \"openvdb\" \"string filename\" \"fire.VDB\"\n"
      "MakeNamedMedium \"z\" \"string type\" \"uniformgrid\" \"float density\" 1\n"
      "\"vector3 velocity\" [0 0 0]\n"
      "MediumInterface \"u\" \"n\" MediumInterface \"v\" \"z\"\n");
  ASSERT_EQ(scene.media.size(), 4u);
  const auto& grid = std::get<UniformGridMedium>(scene.media[0].kind);
  EXPECT_EQ(grid.velocity, (std::vector<Vec3f>{{1, 2, 3}, {4, 5, 6}}));
  EXPECT_EQ(scene.media[0].velocity_scale, -2);
  EXPECT_EQ(std::get<VolumeFileMedium>(scene.media[1].kind).velocity_grid, "vel");
  for (size_t i = 0; i < 4; ++i) EXPECT_EQ(scene.media[i].Moves(), i < 2) << i;
  EXPECT_THAT(notes_, ::testing::HasSubstr("main.pbrt:8:1: medium \"z\": parameter \"velocity\" "
                                           "has no effect: it is 0 in all cells"));
}

TEST_F(MediumReaderTest, GridsOfFilesAreChosenByName) {
  const SceneDescription scene = ReadGood(
      "WorldBegin\nMakeNamedMedium \"a\" \"string type\" \"nanovdb\" \"string filename\" "
      "\"smoke.nvdb\"\n"
      "MakeNamedMedium \"b\" \"string type\" \"openvdb\" \"string filename\" \"fire.VDB\" "
      "\"string gridname\" \"\" \"string temperaturename\" \"heat\"\n"
      "MediumInterface \"a\" \"b\"\n");
  ASSERT_EQ(scene.media.size(), 2u);
  const auto& plain = std::get<VolumeFileMedium>(scene.media[0].kind);
  EXPECT_EQ(plain.density_grid, "density");
  EXPECT_FALSE(plain.temperature_grid.has_value());
  const auto& named = std::get<VolumeFileMedium>(scene.media[1].kind);
  EXPECT_EQ(named.density_grid, "");
  EXPECT_EQ(named.temperature_grid, "heat");
}

TEST_F(MediumReaderTest, InvalidVelocitiesAreRefusedWithTheirLocation) {
  const auto message = [this](const std::string& parameters) {
    const absl::StatusOr<ReadSceneResult> result =
        Read("WorldBegin\nMakeNamedMedium \"m\" \"string type\" \"uniformgrid\"\n  " + parameters +
             " \"float density\" 1\nMediumInterface \"m\" \"\"\n");
    EXPECT_FALSE(result.ok());
    return std::string(result.status().message());
  };
  using ::testing::HasSubstr;
  EXPECT_THAT(message("\"vector3 velocity\" [1 nan 0]"),
              HasSubstr("main.pbrt:3:25: parameter \"velocity\": \"nan\" is not a number"));
  EXPECT_THAT(message("\"vector3 velocity\" [1 2 3 4 5 6]"),
              HasSubstr("\"velocity\" needs nx * ny * nz = 1 vectors but has 2"));
  EXPECT_THAT(message("\"float velocity\" [1 2 3]"), HasSubstr("main.pbrt:3:3: "));
  EXPECT_THAT(message("\"vector3 velocity\" [1 2 3] \"float velocityscale\" inf"),
              HasSubstr("main.pbrt:3:52: parameter \"velocityscale\": \"inf\" is not a number"));
}

TEST_F(MediumReaderTest, PathIntegratorIgnoresMediaWithAWarning) {
  const SceneDescription scene = ReadGood(
      "Integrator \"path\"\nMakeNamedMedium \"fog\" \"string type\" \"homogeneous\"\n"
      "MediumInterface \"\" \"fog\"\nCamera \"perspective\"\nWorldBegin\nShape \"sphere\"\n");
  EXPECT_TRUE(scene.media.empty());
  EXPECT_EQ(scene.camera.medium, kNone);
  EXPECT_FALSE(scene.shapes[0].media.Separates());
  EXPECT_THAT(notes_, ::testing::HasSubstr("main.pbrt:2:1: media have no effect"));
}

TEST_F(MediumReaderTest, DuplicateNamesReportBothLocations) {
  const absl::StatusOr<ReadSceneResult> result = Read(
      "WorldBegin\nMakeNamedMedium \"m\" \"string type\" \"homogeneous\"\n"
      "MakeNamedMedium \"m\" \"string type\" \"homogeneous\"\n");
  ASSERT_FALSE(result.ok());
  EXPECT_THAT(std::string(result.status().message()),
              ::testing::HasSubstr(
                  "main.pbrt:3:1: medium \"m\" is defined twice; the first is at main.pbrt:2:1"));
}

}  // namespace
}  // namespace sheaf
