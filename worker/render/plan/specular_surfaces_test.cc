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
