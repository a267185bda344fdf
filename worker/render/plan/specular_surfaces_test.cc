// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/plan/specular_surfaces.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <utility>

#include "common/math/transform.h"

namespace sheaf::render {
namespace {

template <typename Material>
bool MayBeSpecular(Material material) {
  SceneDescription scene;
  scene.materials.push_back({"", DiffuseMaterial{}, {}});
  scene.materials.push_back({"", std::move(material), {}});
  return MayHaveSpecularSurfaces(scene);
}

template <typename Material>
Material WithRoughness(float u, float v, int32_t texture = kNone) {
  Material material;
  material.roughness = {{u, texture}, {v, texture}, true};
  return material;
}

PrincipledMaterial Principled(float metallic, float roughness) {
  PrincipledMaterial material;
  material.metallic.value = metallic;
  material.roughness.value = roughness;
  return material;
}

TEST(SpecularSurfacesTest, AreSmoothGlassAndMirrors) {
  EXPECT_FALSE(MayHaveSpecularSurfaces({}));
  EXPECT_FALSE(MayBeSpecular(DiffuseMaterial{}));
  EXPECT_FALSE(MayBeSpecular(WithRoughness<CoatedDiffuseMaterial>(0, 0)));
  EXPECT_FALSE(MayBeSpecular(InterfaceMaterial{}));
  EXPECT_TRUE(MayBeSpecular(WithRoughness<DielectricMaterial>(0, 0)));
  EXPECT_FALSE(MayBeSpecular(WithRoughness<DielectricMaterial>(0.2f, 0)));
  EXPECT_TRUE(MayBeSpecular(WithRoughness<DielectricMaterial>(0.2f, 0.2f, 3)));
  EXPECT_TRUE(MayBeSpecular(ThinDielectricMaterial{}));
  EXPECT_TRUE(MayBeSpecular(WithRoughness<ConductorMaterial>(0, 0)));
  EXPECT_FALSE(MayBeSpecular(WithRoughness<ConductorMaterial>(0.3f, 0.3f)));
}

TEST(SpecularSurfacesTest, AreNamedForStereoFrames) {
  SceneDescription scene;
  scene.files = {"room.pbrt"};
  const auto add = [&scene](auto material, int32_t line) {
    scene.materials.push_back({"", material, {0, line, 1}});
  };
  add(DiffuseMaterial{}, 3);
  EXPECT_EQ(StereoNote(scene), "stereo: both eyes share the paths that begin at rough surfaces");
  add(ThinDielectricMaterial{}, 4);
  EXPECT_THAT(StereoNote(scene),
              ::testing::EndsWith("rough surfaces; those with two rough surfaces or more behind up "
                                  "to 4 mirrors and smooth glasses (room.pbrt:4:1)"));
  for (int32_t line = 5; line < 9; ++line) add(HairMaterial{}, line);
  EXPECT_THAT(StereoNote(scene),
              ::testing::EndsWith("(room.pbrt:4:1); none at hair (room.pbrt:5:1, room.pbrt:6:1, "
                                  "room.pbrt:7:1 and 1 more)"));
}

TEST(SpecularSurfacesTest, PlansSayWhichViewsShare) {
  SceneDescription scene;
  const std::string by_filter = "sharing: paths count in all pixels whose filters cover them";
  EXPECT_EQ(SharingNote(scene, false, false), by_filter);
  EXPECT_EQ(SharingNote(scene, true, false),
            by_filter + "; views: none share paths, as the camera has no lens and does not move");
  scene.camera.lens_radius = 0.1f;
  EXPECT_EQ(SharingNote(scene, true, true),
            by_filter +
                "; views: up to 8 points of the lens share the paths that begin at rough "
                "surfaces; times of the shutter share none, as more than the camera moves");
  scene.camera.lens_radius = 0;
  scene.camera.shutter_close = 1;
  scene.camera.world_from_camera.end = TranslateMatrix({1, 0, 0});
  EXPECT_EQ(SharingNote(scene, true, false),
            by_filter +
                "; views: up to 8 points of the shutter share the paths that begin at "
                "rough surfaces");
  EXPECT_THAT(SharingNote(scene, true, true), ::testing::EndsWith("and is not all that moves"));
}

TEST(SpecularSurfacesTest, ArePrincipledOnesWithoutADiffusePart) {
  EXPECT_FALSE(MayBeSpecular(Principled(0, 0)));
  EXPECT_TRUE(MayBeSpecular(Principled(1, 0)));
  EXPECT_FALSE(MayBeSpecular(Principled(1, 0.5f)));
  PrincipledMaterial textured = Principled(0, 0.5f);
  textured.metallic.texture = 2;
  EXPECT_FALSE(MayBeSpecular(textured));
  textured.roughness.texture = 1;
  EXPECT_TRUE(MayBeSpecular(textured));
}

}  // namespace
}  // namespace sheaf::render
