// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_ladder.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "worker/render/traits/trait_set.h"

namespace sheaf::cli {
namespace {

render::RenderPlan PlanOfFog() {
  render::RenderPlan plan;
  plan.max_depth = 8;
  plan.light_count = 2;
  plan.traits = render::TraitSet(render::Trait::kMedia, render::Trait::kHeterogeneousMedia);
  return plan;
}

std::vector<std::string> NamesOf(const std::vector<StudySetting>& ladder) {
  std::vector<std::string> names;
  for (const StudySetting& setting : ladder) names.push_back(setting.name);
  return names;
}

bool HasName(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

TEST(StudyLadderTest, FramesWithLightPathsAreComparedWithoutThem) {
  FrameSettings settings;
  settings.techniques = TechniqueSet::kCameraAndLightGuided;
  const std::vector<StudySetting> ladder = MakeLadder(settings, PlanOfFog());
  EXPECT_TRUE(ladder[0].is_base);
  EXPECT_TRUE(ladder[1].is_without_light_paths);
  EXPECT_TRUE(ladder[1].is_unbiased);
  EXPECT_EQ(ladder[1].settings.techniques, TechniqueSet::kCameraGuided);
  EXPECT_EQ(ladder[1].flag, "--techniques camera+guiding");
  for (size_t i = 0; i < ladder.size(); ++i) {
    EXPECT_EQ(ladder[i].settings.techniques == settings.techniques, i != 1) << ladder[i].name;
  }
}

TEST(StudyLadderTest, LightPathsAloneAreComparedWithBothKinds) {
  FrameSettings settings;
  settings.techniques = TechniqueSet::kLight;
  const std::vector<StudySetting> ladder = MakeLadder(settings, PlanOfFog());
  EXPECT_EQ(ladder[1].settings.techniques, TechniqueSet::kCamera);
  EXPECT_EQ(ladder[2].settings.techniques, TechniqueSet::kCameraAndLight);
}

// Similarity is refused with light paths, and lines of media are not sampled beside them.
TEST(StudyLadderTest, WhatLightPathsExcludeIsNamed) {
  FrameSettings settings;
  const std::vector<std::string> camera = NamesOf(MakeLadder(settings, PlanOfFog()));
  settings.techniques = TechniqueSet::kCameraAndLight;
  const std::vector<std::string> light = NamesOf(MakeLadder(settings, PlanOfFog()));
  for (const char* name : {"similarity", "distance samples only", "always equiangular"}) {
    EXPECT_TRUE(HasName(camera, name)) << name;
    EXPECT_FALSE(HasName(light, name)) << name;
  }
  EXPECT_FALSE(HasName(camera, "no light paths"));
  EXPECT_TRUE(HasName(MissingLadders(settings, PlanOfFog()),
                      "similarity and equiangular sampling: neither is combined with light paths"));
}

}  // namespace
}  // namespace sheaf::cli
