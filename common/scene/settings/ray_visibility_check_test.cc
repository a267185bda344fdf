// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/settings/ray_visibility_check.h"

#include <string>

#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

SceneDescription SceneWithHiddenShape() {
  SceneDescription scene;
  scene.files = {"test.pbrt"};
  scene.shapes.emplace_back().invisible = BitOf(RayKind::kGlossy);
  scene.shapes.back().location = {0, 7, 3};
  return scene;
}

TEST(RayVisibilityCheckTest, FindsShapesAndLights) {
  EXPECT_EQ(FirstInvisible(SceneDescription()), nullptr);
  EXPECT_NE(FirstInvisible(SceneWithHiddenShape()), nullptr);
  SceneDescription scene;
  scene.lights.emplace_back().invisible = BitOf(RayKind::kCamera);
  EXPECT_NE(FirstInvisible(scene), nullptr);
}

TEST(RayVisibilityCheckTest, OtherPathsAreRefused) {
  const SceneDescription scene = SceneWithHiddenShape();
  RenderSettings settings;
  for (const TechniqueSet techniques :
       {TechniqueSet::kCameraAndLight, TechniqueSet::kLight, TechniqueSet{Technique::kSharing},
        TechniqueSet{Technique::kMutations}}) {
    settings.techniques = techniques;
    const absl::Status refused = ResolveSettings(scene, settings).status();
    EXPECT_EQ(refused.code(), absl::StatusCode::kInvalidArgument) << techniques.Name();
    EXPECT_THAT(std::string(refused.message()), ::testing::HasSubstr("test.pbrt:7:3"));
    EXPECT_THAT(std::string(refused.message()), ::testing::HasSubstr("--techniques camera"));
    EXPECT_TRUE(ResolveSettings(SceneDescription(), settings).ok()) << techniques.Name();
  }
  settings.techniques = TechniqueSet::kCameraGuided;
  EXPECT_TRUE(ResolveSettings(scene, settings).ok());
  settings.techniques.reset();
  settings.eye_distance = 0.1f;
  EXPECT_THAT(std::string(ResolveSettings(scene, settings).status().message()),
              ::testing::HasSubstr("stereo"));
}

TEST(RayVisibilityCheckTest, CamerasWithClipPlanesAreNamed) {
  SceneDescription scene;
  scene.files = {"test.pbrt"};
  scene.camera.location = {0, 2, 1};
  scene.camera.far_clip = 9;
  EXPECT_EQ(FirstInvisible(scene), &scene.camera.location);
  RenderSettings settings;
  settings.techniques = TechniqueSet::kLight;
  EXPECT_THAT(std::string(ResolveSettings(scene, settings).status().message()),
              ::testing::HasSubstr("test.pbrt:2:1: \"nearclip\" or \"farclip\": the scene has"));
}

TEST(RayVisibilityCheckTest, TheFilesLightPathsAreLeftOut) {
  SceneDescription scene = SceneWithHiddenShape();
  scene.sampling.integrator = "bdpt";
  const absl::StatusOr<FrameSettings> settings = ResolveSettings(scene, {});
  ASSERT_TRUE(settings.ok()) << settings.status();
  EXPECT_EQ(settings->techniques, TechniqueSet::kCamera);
}

}  // namespace
}  // namespace sheaf
