// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/stereo.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace sheaf {
namespace {

using ::testing::HasSubstr;

RenderSettings Eyes() {
  RenderSettings settings;
  settings.eye_distance = 0.065f;
  settings.eye_convergence = 2;
  return settings;
}

std::string WhyNot(const SceneDescription& scene, const RenderSettings& settings) {
  return std::string(ResolveSettings(scene, settings).status().message());
}

TEST(StereoTest, TheFilmHasBothEyes) {
  SceneDescription scene;
  scene.film.width_px = 30;
  scene.film.height_px = 20;
  const absl::StatusOr<FrameSettings> settings = ResolveSettings(scene, Eyes());
  ASSERT_TRUE(settings.ok()) << settings.status();
  EXPECT_TRUE(settings->IsStereo());
  EXPECT_EQ(settings->width_px, 60);
  EXPECT_EQ(settings->window, (PixelRect{0, 0, 60, 20}));
  EXPECT_EQ(WhyNoStereo(*settings), "");
  EXPECT_FALSE(ResolveSettings(scene, {})->IsStereo());
}

TEST(StereoTest, TechniquesOfTheSceneAreLeftOut) {
  SceneDescription scene;
  scene.sampling.integrator = "bdpt";
  EXPECT_EQ(ResolveSettings(scene, Eyes())->techniques, TechniqueSet::kCamera);
}

TEST(StereoTest, OtherFramesAreRefused) {
  const SceneDescription plain;
  SceneDescription round;
  round.camera.kind = CameraDescription::Kind::kEqualArea;
  EXPECT_THAT(WhyNot(round, Eyes()), HasSubstr("needs a perspective camera"));
  RenderSettings settings = Eyes();
  settings.crop = PixelRect{0, 0, 8, 8};
  EXPECT_THAT(WhyNot(plain, settings), HasSubstr("remove the crop"));
  settings = Eyes();
  settings.techniques = TechniqueSet::kCameraAndLight;
  EXPECT_THAT(WhyNot(plain, settings), HasSubstr("camera+light; use --techniques camera"));
  settings = Eyes();
  settings.measure_techniques = true;  // Which of them share paths is measured.
  EXPECT_EQ(WhyNot(plain, settings), "");
  settings = Eyes();
  settings.light_samples = 4;
  EXPECT_THAT(WhyNot(plain, settings), HasSubstr("remove --light-samples"));
  settings = Eyes();
  settings.outputs.Add(Aov::kUv);
  EXPECT_THAT(WhyNot(plain, settings), HasSubstr("remove the outputs"));
}

TEST(StereoTest, DistancesAreNumbers) {
  EXPECT_TRUE(AreEyeDistances(0, 0));
  EXPECT_TRUE(AreEyeDistances(0.065f, 2));
  EXPECT_FALSE(AreEyeDistances(-1, 0));
  EXPECT_FALSE(AreEyeDistances(NAN, 0));
  EXPECT_FALSE(AreEyeDistances(1, HUGE_VALF));
}

}  // namespace
}  // namespace sheaf
