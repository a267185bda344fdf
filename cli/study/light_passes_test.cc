// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/light_passes.h"

#include <gtest/gtest.h>

#include "cli/study/setting_renderer.h"
#include "tests/support/test_scene.h"

namespace sheaf::cli {
namespace {

constexpr int32_t kFramePx = 24;

FrameSettings SettingsWithLight() {
  FrameSettings settings;
  settings.width_px = settings.height_px = kFramePx;
  settings.window = {0, 0, kFramePx, kFramePx};
  settings.techniques = TechniqueSet::kCameraAndLight;
  return settings;
}

// The numbers of pixels of a smaller frame, row-major.
FrameImage Numbered(const PixelRect& window, int32_t width_px, int32_t height_px) {
  FrameImage image = MakeFrameImage(window, width_px, height_px);
  for (size_t p = 0; p < image.planes.front().size(); ++p) {
    (*image.Find("R"))[p] = static_cast<float>(p);
  }
  return image;
}

TEST(LightOfTest, EachPixelIsThatInItsPlace) {
  const FrameImage light =
      LightOf(Numbered({0, 0, 3, 2}, 3, 2), {2, 0, 6, 4}, /*frame_width_px=*/6, 4);
  EXPECT_EQ(*light.Find("R"), (std::vector<float>{1, 1, 2, 2, 1, 1, 2, 2, 4, 4, 5, 5, 4, 4, 5, 5}));
}

TEST(LightOfTest, AnImageOfTheFrameStaysAsItIs) {
  const FrameImage image = Numbered({1, 1, 4, 3}, 5, 4);
  EXPECT_EQ(*LightOf(image, {1, 1, 4, 3}, 5, 4).Find("R"), *image.Find("R"));
}

// A crop's smaller frame may end before the crop does, by rounding.
TEST(LightOfTest, PixelsBesideTheWindowAreItsNearest) {
  const FrameImage light = LightOf(Numbered({1, 1, 2, 2}, 4, 4), {0, 0, 8, 8}, 8, 8);
  for (const float value : *light.Find("R")) EXPECT_EQ(value, 0);
}

class LightPassesTest : public ::testing::Test {
 protected:
  StudyScene Compile(int32_t shrink, TechniqueSet techniques = TechniqueSet::kCameraAndLight) {
    FrameSettings settings = SettingsWithLight();
    settings.techniques = techniques;
    StudyScenes scenes(room_.scene, files_, 2);
    absl::StatusOr<StudyScene> scene = scenes.Compile(settings, shrink);
    EXPECT_TRUE(scene.ok()) << scene.status();
    return *std::move(scene);
  }

  TableFileSource files_{{}};
  render::TestScene room_ = render::LitRoom(1);
};

// The number of threads, and of calls, changes no bit.
TEST_F(LightPassesTest, ImagesAreOfThePassesAlone) {
  const StudyScene scene = Compile(1);
  LightPasses one(*scene.light(), 1), many(*scene.light(), 3);
  ASSERT_TRUE(one.RenderUntil(kStudyBlockSamples).ok());
  for (const uint64_t count : {3, 5, 16}) ASSERT_TRUE(many.RenderUntil(count).ok());
  EXPECT_EQ(ImageDigest(one.Image()), ImageDigest(many.Image()));
  EXPECT_EQ(one.Image().Find("samples")->front(), kStudyBlockSamples);
}

// In a room whose light has no fine structure, the smaller frame has the frame's mean and relative
// variance.
TEST_F(LightPassesTest, ASmallerFrameHasTheSameLight) {
  const StudyScene scene = Compile(3);
  ASSERT_EQ(SettingsOf(*scene.light()).width_px, kFramePx / 3);
  LightPasses whole(*scene.frame, 2), small(*scene.light(), 2);
  ASSERT_TRUE(whole.RenderUntil(64).ok() && small.RenderUntil(256).ok());
  const auto mean_of = [](const FrameImage& image) {
    double sum = 0;
    for (const float value : *image.Find("G")) sum += static_cast<double>(value);
    return sum / static_cast<double>(image.window.PixelCount());
  };
  EXPECT_GT(mean_of(whole.Image()), 0.005);
  EXPECT_NEAR(mean_of(small.Image()) / mean_of(whole.Image()), 1, 0.05);
  // A pass of the frame has nine times as many paths.
  EXPECT_NEAR(small.CpuSeconds(kFramePx * kFramePx) / small.CpuSeconds(kFramePx * kFramePx / 9), 9,
              1e-6);
}

// The tiles of a room at 128 samples.
double MeanOfTiles(const StudyScene& scene) {
  const std::vector<PixelRect> tiles = {{0, 0, kFramePx, kFramePx}};
  SettingRenderer renderer(scene, tiles, 1, 2);
  for (int i = 0; i < 8; ++i) EXPECT_TRUE(renderer.tiles().RenderBlock().ok());
  EXPECT_EQ(renderer.LightCpuSeconds() > 0, renderer.has_light());
  EXPECT_GE(renderer.CpuSeconds(), scene.training_cpu_seconds);
  double sum = 0;
  const TilePixels pixels = renderer.tiles().Develop(0);
  for (const auto& value : pixels.value) sum += static_cast<double>(value[1]);
  return sum / static_cast<double>(pixels.value.size());
}

// Together the tiles of camera and light paths show what paths from the camera alone show.
TEST_F(LightPassesTest, TilesShowBothKindsOfPath) {
  const double camera = MeanOfTiles(Compile(1, TechniqueSet::kCamera));
  EXPECT_NEAR(MeanOfTiles(Compile(1)) / camera, 1, 0.03);
  EXPECT_NEAR(MeanOfTiles(Compile(3)) / camera, 1, 0.03);
  EXPECT_NEAR(MeanOfTiles(Compile(1, TechniqueSet::kLight)) / camera, 1, 0.03);
}

// The weights of tile and smaller frame agree, whatever the seed of a setting.
TEST_F(LightPassesTest, GuidedScenesShareOneField) {
  const double camera = MeanOfTiles(Compile(1, TechniqueSet::kCamera));
  FrameSettings settings = SettingsWithLight();
  settings.techniques = TechniqueSet::kCameraAndLightGuided;
  StudyScenes scenes(room_.scene, files_, 2);
  const absl::StatusOr<StudyScene> given = scenes.Compile(settings, 3);
  ASSERT_TRUE(given.ok()) << given.status();
  EXPECT_GT(given->training_cpu_seconds, 0);
  settings.seed ^= 5;
  const absl::StatusOr<StudyScene> other = scenes.Compile(settings, 3);
  ASSERT_TRUE(other.ok()) << other.status();
  EXPECT_EQ(other->training_cpu_seconds, given->training_cpu_seconds);
  EXPECT_NEAR(MeanOfTiles(*other) / camera, 1, 0.03);
  // Without light paths, a setting is guided by a field of its own.
  settings.techniques = TechniqueSet::kCameraGuided;
  const absl::StatusOr<StudyScene> alone = scenes.Compile(settings, 3);
  ASSERT_TRUE(alone.ok()) << alone.status();
  EXPECT_GT(alone->training_cpu_seconds, 0);
  EXPECT_NE(alone->training_cpu_seconds, given->training_cpu_seconds);
  EXPECT_EQ(alone->light(), nullptr);
}

}  // namespace
}  // namespace sheaf::cli
