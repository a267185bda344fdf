// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/job/camera_paths_check.h"

#include <gtest/gtest.h>

namespace sheaf::cli {
namespace {

constexpr char kWhat[] = "measurements of effects";

TEST(CameraPathsCheckTest, OnlyPathsFromTheCameraPass) {
  EXPECT_TRUE(CheckCameraPaths(kWhat, TechniqueSet::kCamera).ok());
  EXPECT_EQ(CheckCameraPaths(kWhat, TechniqueSet::kCameraAndLight),
            absl::InvalidArgumentError(
                "measurements of effects know paths from the camera alone, not the techniques "
                "camera+light; give "
                "--techniques camera for an image of the same mean without light paths"));
  EXPECT_FALSE(CheckCameraPaths(kWhat, TechniqueSet::kLight).ok());
  EXPECT_TRUE(CheckCameraPaths(kWhat, TechniqueSet::kCameraGuided).ok());
  EXPECT_EQ(CheckCameraPaths(kWhat, TechniqueSet::kCameraAndLightGuided),
            absl::InvalidArgumentError(
                "measurements of effects know paths from the camera alone, not the techniques "
                "camera+light+guiding; "
                "give --techniques camera+guiding for an image of the same mean without light "
                "paths"));
}

TEST(CameraPathsCheckTest, NamesTheIntegratorThatAsksForLightPaths) {
  SceneDescription scene;
  scene.files = {"main.pbrt"};
  scene.sampling.integrator = "bdpt";
  scene.sampling.integrator_location = {0, 4, 2};
  FrameSettings settings;
  EXPECT_TRUE(CheckCameraPaths(kWhat, scene, settings).ok());
  settings.techniques = TechniqueSet::kCameraAndLight;
  const std::string of_scene(CheckCameraPaths(kWhat, scene, settings).message());
  EXPECT_EQ(
      of_scene.rfind("main.pbrt:4:2: measurements of effects know paths from the camera alone", 0),
      0u)
      << of_scene;
  settings.techniques = TechniqueSet::kLight;  // By a flag.
  const std::string of_flag(CheckCameraPaths(kWhat, scene, settings).message());
  EXPECT_EQ(of_flag.rfind("measurements of effects know", 0), 0u) << of_flag;
}

}  // namespace
}  // namespace sheaf::cli
