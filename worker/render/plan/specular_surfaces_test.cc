// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/plan/specular_surfaces.h"

#include <gtest/gtest.h>

#include <utility>

namespace sheaf::render {
namespace {

template <typename Material>
bool MayBeSpecular(Material material) {
  SceneDescription scene;
  scene.materials.push_back({"", DiffuseMaterial{}, {}});
  scene.materials.push_back({"", std::move(material), {}});
  return MayHaveSpecularSurfaces(scene);
}

RoughnessInput Roughness(float u, float v, int32_t texture = kNone) {
  return {{u, texture}, {v, texture}, true};
}

TEST(SpecularSurfacesTest, AreSmoothGlassAndMirrors) {
  EXPECT_FALSE(MayHaveSpecularSurfaces({}));
  EXPECT_FALSE(MayBeSpecular(DiffuseMaterial{}));
  CoatedDiffuseMaterial varnish;
  varnish.roughness = Roughness(0, 0);
  EXPECT_FALSE(MayBeSpecular(varnish));
  EXPECT_FALSE(MayBeSpecular(InterfaceMaterial{}));
  EXPECT_TRUE(MayBeSpecular(DielectricMaterial{.roughness = Roughness(0, 0)}));
  EXPECT_FALSE(MayBeSpecular(DielectricMaterial{.roughness = Roughness(0.2f, 0)}));
  EXPECT_TRUE(MayBeSpecular(DielectricMaterial{.roughness = Roughness(0.2f, 0.2f, 3)}));
  EXPECT_TRUE(MayBeSpecular(ThinDielectricMaterial{}));
  EXPECT_TRUE(MayBeSpecular(ConductorMaterial{.roughness = Roughness(0, 0)}));
  EXPECT_FALSE(MayBeSpecular(ConductorMaterial{.roughness = Roughness(0.3f, 0.3f)}));
}

TEST(SpecularSurfacesTest, ArePrincipledOnesWithoutADiffusePart) {
  EXPECT_FALSE(MayBeSpecular(PrincipledMaterial{.roughness = {.value = 0}}));
  EXPECT_TRUE(
      MayBeSpecular(PrincipledMaterial{.metallic = {.value = 1}, .roughness = {.value = 0}}));
  EXPECT_TRUE(
      MayBeSpecular(PrincipledMaterial{.metallic = {.texture = 2}, .roughness = {.texture = 1}}));
  EXPECT_FALSE(
      MayBeSpecular(PrincipledMaterial{.metallic = {.value = 1}, .roughness = {.value = 0.5f}}));
}

}  // namespace
}  // namespace sheaf::render
