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
  const MaterialNeedsTable table(scene);
  const MaterialNeeds& needs = table.Of(kLevels);
  EXPECT_TRUE(needs.reads_textures);
  EXPECT_TRUE(needs.may_pass);
}

// Each level has many mixes, and each of these leads to all levels below it: a walk for each mix
// would take 2.6e9 steps.
TEST(MaterialTraitsTest, NeedsAreFoundOnceForEachMaterial) {
  constexpr int32_t kWidth = 1 << 11, kLevels = 60;
  SceneDescription scene;
  scene.materials.resize(kWidth);
  DiffuseMaterial colored;
  colored.reflectance.texture = 0;
  scene.materials[1].material = std::move(colored);
  for (int32_t level = 1; level < kLevels; ++level) {
    for (int32_t i = 0; i < kWidth; ++i) {
      const int32_t below = (level - 1) * kWidth;
      scene.materials.emplace_back().material =
          MixMaterial{{below + 2 * i % kWidth, below + (2 * i + 1) % kWidth}, {.value = 0.5f}};
    }
  }
  const MaterialNeedsTable table(scene);
  for (int32_t i = 0; i < kWidth; ++i) {
    EXPECT_EQ(table.Of(i).reads_textures, i == 1);
    EXPECT_FALSE(table.Of(i).may_pass);
    EXPECT_TRUE(table.Of(kWidth * kLevels - 1 - i).reads_textures);
    EXPECT_TRUE(table.Of(kWidth * kLevels - 1 - i).may_pass);
  }
  EXPECT_FALSE(table.Of(kNone).reads_textures);
}

}  // namespace
}  // namespace sheaf::render
