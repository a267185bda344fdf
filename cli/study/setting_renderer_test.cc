// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/setting_renderer.h"

#include <gtest/gtest.h>

#include "cli/study/study_reference.h"
#include "tests/support/test_scene.h"

namespace sheaf::cli {
namespace {

constexpr int32_t kGlassRoomPx = 32;
constexpr uint64_t kReferenceBlocks = 4, kTestedBlocks = 2;

// A study's measurements in a room with a ball of glass, where light paths find all light that they
// can: a pixel's error at this depth against the image of depth 6, with light passes on a frame
// that is `shrink` times smaller.
double MeasuredError(int32_t shrink, int32_t depth) {
  render::TestScene room = render::LitRoom(1);
  room.AddShape(SphereShape{0.3f, -0.3f, 0.3f, 360}, room.AddMaterial(DielectricMaterial()),
                TranslateMatrix({-0.3, -0.4, 0.3}));
  TableFileSource files({});
  FrameSettings settings = render::SquareSettings(kGlassRoomPx, 16, 6);
  settings.techniques = TechniqueSet::kLight;
  settings.seed = 1;
  const std::vector<PixelRect> tiles = ChooseTiles(settings.window, 1000);
  StudyScenes scenes(room.scene, files, 2);
  const absl::StatusOr<StudyScene> truth = scenes.Compile(settings, shrink);
  EXPECT_TRUE(truth.ok()) << truth.status();
  TileRenderer camera(*truth->frame, tiles, 2);
  EXPECT_TRUE(RenderBlocks(&camera, kReferenceBlocks, [] { return true; }).ok());
  const auto light_of = [&](const render::CompiledScene& frame) {
    LightPasses passes(frame, 2);
    EXPECT_TRUE(passes.RenderUntil(kReferenceBlocks * kStudyBlockSamples).ok());
    return LightOfTiles(passes.Image(), tiles, kGlassRoomPx, kGlassRoomPx);
  };
  const StudyReference reference(DevelopAll(camera, tiles.size()), light_of(*truth->frame),
                                 light_of(*truth->light()));

  settings.seed = 2;
  settings.max_depth = depth;
  const absl::StatusOr<StudyScene> scene = scenes.Compile(settings, shrink);
  EXPECT_TRUE(scene.ok()) << scene.status();
  SettingRenderer renderer(*scene, tiles, 1, 2);
  EXPECT_TRUE(RenderBlocks(&renderer.tiles(), kTestedBlocks, [] { return true; }).ok());
  double error = 0;
  for (size_t tile = 0; tile < tiles.size(); ++tile) {
    error += reference.ErrorOf(tile, renderer.tiles().Develop(tile), renderer.has_light());
  }
  return error / (kGlassRoomPx * kGlassRoomPx);
}

TEST(SettingRendererTest, ErrorsOfASmallerFrameAreThoseOfTheFrame) {
  const double of_frame = MeasuredError(1, 6), of_smaller = MeasuredError(2, 6);
  EXPECT_GT(of_frame, 1e-3);
  EXPECT_NEAR(of_smaller / of_frame, 1, 0.3) << of_smaller << " for " << of_frame;
}

// Depth 1 leaves out the light of most paths of both kinds. At edges, the smaller frame has a part
// of the light of either side.
TEST(SettingRendererTest, BiasOfASmallerFrameIsThatOfTheFrame) {
  const double of_frame = MeasuredError(1, 1), of_smaller = MeasuredError(2, 1);
  EXPECT_GT(of_frame, 0.05);
  EXPECT_NEAR(of_smaller / of_frame, 1, 0.25) << of_smaller << " for " << of_frame;
}

}  // namespace
}  // namespace sheaf::cli
