// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_paths.h"

#include <gtest/gtest.h>

#include "tests/support/test_scene.h"

namespace sheaf::cli {
namespace {

constexpr int32_t kRoomPx = 32;

StudyPaths MeasureRoom(TechniqueSet techniques, int32_t shrink) {
  const render::TestScene room = render::LitRoom(1);
  TableFileSource files({});
  FrameSettings settings = render::SquareSettings(kRoomPx, 64, 5);
  settings.techniques = techniques;
  settings.outputs.AddLightPaths();
  StudyScenes scenes(room.scene, files, 2);
  const absl::StatusOr<StudyScene> scene = scenes.Compile(settings, shrink);
  EXPECT_TRUE(scene.ok()) << scene.status();
  absl::StatusOr<StudyPaths> paths =
      MeasurePathNoise(*scene, {{0, 0, 16, 16}, {16, 16, 32, 32}}, 0.1, 2, 600);
  EXPECT_TRUE(paths.ok()) << paths.status();
  return *std::move(paths);
}

double LightOf(const StudyPaths& paths, LightPathKind kind) {
  for (const StudyPath& path : paths.paths) {
    if (path.kind == kind) return path.fractions.light;
  }
  return 0;
}

// Light that begins at lights counts for its kinds, whose fractions stay what they are.
TEST(StudyPathsTest, KindsHaveTheLightOfBothKindsOfPath) {
  const StudyPaths camera = MeasureRoom(TechniqueSet::kCamera, 0);
  EXPECT_EQ(camera.assessed_tile_count, 2u);
  for (const int32_t shrink : {1, 2}) {
    const StudyPaths both = MeasureRoom(TechniqueSet::kCameraAndLight, shrink);
    double light = 0, noise = 0;
    for (const StudyPath& path : both.paths) {
      light += path.fractions.light;
      noise += path.fractions.variance;
    }
    EXPECT_NEAR(light, 1, 1e-9);
    EXPECT_NEAR(noise, 1, 1e-9);
    for (const LightPathKind kind : {LightPathKind::kDirect, LightPathKind::kIndirect}) {
      EXPECT_GT(LightOf(camera, kind), 0.1);
      EXPECT_NEAR(LightOf(both, kind) / LightOf(camera, kind), 1, 0.1) << shrink;
    }
  }
  // Paths from the camera alone see almost nothing where light paths find all that they can.
  const StudyPaths light_alone = MeasureRoom(TechniqueSet::kLight, 1);
  EXPECT_NEAR(LightOf(light_alone, LightPathKind::kIndirect),
              LightOf(camera, LightPathKind::kIndirect),
              0.1 * LightOf(camera, LightPathKind::kIndirect));
}

}  // namespace
}  // namespace sheaf::cli
