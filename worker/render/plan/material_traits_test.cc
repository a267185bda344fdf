// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/plan/material_traits.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <utility>

namespace sheaf::render {
namespace {

// 2^levels paths lead from the last mix to the diffuse material.
TEST(MaterialTraitsTest, SharedMixesAreVisitedOnce) {
  constexpr int32_t kLevels = 60;
  SceneDescription scene;
  DiffuseMaterial colored;
  colored.reflectance.texture = 0;
  scene.materials.emplace_back().material = std::move(colored);
  for (int32_t i = 0; i < kLevels; ++i) {
    scene.materials.emplace_back().material = MixMaterial{{i, i}, {.value = 0.5f}};
  }
  const MaterialNeeds needs = NeedsOfMaterial(scene, kLevels);
  EXPECT_TRUE(needs.reads_textures);
  EXPECT_TRUE(needs.may_pass);
}

}  // namespace
}  // namespace sheaf::render
