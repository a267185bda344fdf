// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests images of camera sensors against pbrt-v4's documented model, and clamped samples.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "absl/strings/str_cat.h"
#include "common/film/film.h"
#include "common/scene/spectrum/primaries.h"
#include "tests/support/scene_text.h"
#include "tests/support/sensor_images.h"
#include "tests/support/test_scene.h"
#include "worker/render/camera/film_response.h"

namespace sheaf::render {
namespace {

using ::testing::HasSubstr;

// A constant sky.
SceneDescription ReadSky(const std::string& before_world, const std::string& light) {
  return sheaf::testing::ReadSceneText(
      absl::StrCat(before_world, "\nWorldBegin\nLightSource \"infinite\" ", light, "\n"));
}

std::string Film(const std::string& parameters) {
  return absl::StrCat("Film \"rgb\" \"integer xresolution\" 8 \"integer yresolution\" 8 ",
                      parameters,
                      "\nPixelFilter \"box\"\nSampler \"sobol\" \"integer pixelsamples\" 1024");
}

// Mean color of the delivered image.
Vec3d Delivered(const SceneDescription& scene, const RenderSettings& asked = {}) {
  const absl::StatusOr<FrameSettings> settings = ResolveSettings(scene, asked);
  EXPECT_TRUE(settings.ok()) << settings.status();
  const Rgb mean = RenderMean(scene, *settings).mean;
  return TransformVector(
      ImageColorOf(settings->primaries, settings->white_balance_k, settings->sensor)
          .light_from_srgb,
      {static_cast<double>(mean.r), static_cast<double>(mean.g), static_cast<double>(mean.b)});
}

TEST(FilmResponseTest, RenderedColorsMatchTheSensorModel) {
  for (const sheaf::testing::SensorImage& image : sheaf::testing::SensorImages()) {
    const std::string balance =
        image.white_balance_k == 0
            ? ""
            : absl::StrCat(" \"float whitebalance\" ", image.white_balance_k);
    for (size_t i = 0; i < sheaf::testing::SensorLights().size(); ++i) {
      const sheaf::testing::SensorLight& light = sheaf::testing::SensorLights()[i];
      SCOPED_TRACE(std::string(image.sensor) + ", " + light.name);
      const SceneDescription scene = ReadSky(
          absl::StrCat("ColorSpace \"", image.color_space, "\"\n",
                       Film(absl::StrCat("\"string sensor\" \"", image.sensor, "\"", balance))),
          light.parameter);
      sheaf::testing::ExpectSameColor(Delivered(scene), image.colors[i]);
    }
  }
}

// ISO 50 and a shutter that is open for half the time: a quarter of the light.
TEST(FilmResponseTest, SensorExposureIncludesTheShutter) {
  const std::string half = "\"string sensor\" \"nikon_d850\" \"float iso\" 50";
  const Vec3d full =
      Delivered(ReadSky(Film("\"string sensor\" \"nikon_d850\""), "\"blackbody L\" 5000"));
  const Vec3d quarter = Delivered(
      ReadSky(absl::StrCat("Camera \"perspective\" \"float shutterclose\" 0.5\n", Film(half)),
              "\"blackbody L\" 5000"));
  EXPECT_NEAR(quarter.y, full.y / 4, 1e-6);
  EXPECT_NEAR(Delivered(ReadSky(absl::StrCat("Camera \"perspective\" \"float shutterclose\" 0.5\n",
                                             Film("\"float iso\" 50")),
                                "\"rgb L\" [1 1 1]"))
                  .y,
              0.5, 1e-6);
}

TEST(FilmResponseTest, SensorsUseSpectralTransportByDefault) {
  const SceneDescription scene = ReadSky(
      Film("\"string sensor\" \"nikon_d850\" \"float whitebalance\" 5000"), "\"blackbody L\" 5000");
  RenderSettings asked;
  EXPECT_THAT(FormatRenderPlan(MakeRenderPlan(scene, *ResolveSettings(scene, asked))),
              HasSubstr("Film \"string sensor\" \"nikon_d850\""));
  asked.color = ColorTransport::kRgb;
  EXPECT_THAT(FormatRenderPlan(MakeRenderPlan(scene, *ResolveSettings(scene, asked))),
              HasSubstr("sensor: rgb transport has no wavelengths for nikon_d850; colors are"));
  // The light that is chosen as white remains white, up to the error of the sensor model.
  const Vec3d white = Delivered(scene, asked);
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(white[i], 1, 0.05) << i;
}

// X, Y and Z of the sky are 9.5, 10 and 10.9: the largest becomes 2.
TEST(FilmResponseTest, ClampedSamplesKeepTheirColor) {
  const std::string sky = "\"rgb L\" [10 10 10]";
  const Vec3d clamped = Delivered(ReadSky(Film("\"float maxcomponentvalue\" 2"), sky));
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(clamped[i], 2 / 1.0891, 1e-3);
  const Vec3d below = Delivered(ReadSky(Film("\"float maxcomponentvalue\" 20"), sky));
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(below[i], 10, 1e-4);
  // Exposure is applied before clamping, as in pbrt-v4.
  const Vec3d exposed =
      Delivered(ReadSky(Film("\"float iso\" 1000 \"float maxcomponentvalue\" 20"), sky));
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(exposed[i], 20 / 1.0891, 1e-2);
}

TEST(FilmResponseTest, LayersOfClampedSamplesAddUp) {
  const SceneDescription scene = ReadSky(Film("\"float maxcomponentvalue\" 2"),
                                         "\"rgb L\" [10 5 1] \"string lightgroup\" \"key\"");
  RenderSettings asked;
  asked.light_groups = true;
  const FrameSettings settings = *ResolveSettings(scene, asked);
  const FilmTile tile = RenderAll(*Compile(scene, settings));
  FrameImage image =
      MakeFrameImage(settings.window, settings.width_px, settings.height_px, settings.outputs);
  DevelopTile(tile, &image);
  for (const char* channel : {"R", "G", "B"}) {
    const std::vector<float>* layer = image.Find(absl::StrCat("key.", channel));
    ASSERT_NE(layer, nullptr);
    for (size_t i = 0; i < layer->size(); ++i) {
      EXPECT_NEAR((*layer)[i], (*image.Find(channel))[i], 1e-5f);
    }
  }
  EXPECT_THAT(FormatRenderPlan(MakeRenderPlan(scene, settings)),
              HasSubstr("biased: samples are clamped to 2; errors are those of the clamped image"));
}

}  // namespace
}  // namespace sheaf::render
