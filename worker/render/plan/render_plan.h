// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneDescription > RenderPlan: the effects that the scene uses, their causes, and the compiled
// variant of the integrator that serves them. Effects outside the plan are not run.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/plan/chain_shapes.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

struct PlannedEffect {
  Trait trait{};
  std::string name;   // "lens"
  std::string cause;  // "scenes/room.pbrt:12:1: Camera \"float lensradius\" [0.05]"
  // Time per sample with the effect over the time without, in the small scene of this effect that
  // tests/bench/effect_cost.py measures; 0 if there is none. MeasurePlan gives the ratio for the
  // actual scene.
  double expected_time_ratio = 1;
};
struct RenderPlan {
  TraitBits traits = 0;          // The scene's.
  TraitBits variant_traits = 0;  // The compiled variant's: a superset of traits.
  std::string variant_name;
  // The settings' value, or less where deeper paths would carry exactly zero light.
  int32_t max_depth = 0;
  std::string depth_cause;             // Cause of a reduced max_depth; else empty.
  size_t light_count = 0;              // Emissive triangles, spheres, disks and other lights.
  std::vector<PlannedEffect> effects;  // In the order of Trait.
  std::vector<std::string> unused;     // Names of the effects that the scene does not use.
  // Shapes that chains lead through, and lamps that they lead to: chain_shapes.h. Empty in frames
  // without chains, unless the scene is for SetTechniques.
  ChainShapes chain_shapes;
  // Other facts that matter for the image: one line each.
  std::vector<std::string> notes;
};

// The traits that the settings' techniques alone decide; and those of these settings.
inline constexpr TraitBits kTechniqueTraits =
    TraitSet(Trait::kGuiding, Trait::kLightSplits, Trait::kLearnedLights);
constexpr TraitBits TechniqueTraits(const FrameSettings& settings) {
  // Guided frames know lights with the trait of guiding. Choices by product have the code of
  // learned lights, with or without rows.
  const bool learns_lights =
      (LearnsLights(settings.techniques) && !IsGuided(settings.techniques)) ||
      ChoosesByProduct(settings.techniques);
  return (IsGuided(settings.techniques) ? static_cast<TraitBits>(Trait::kGuiding) : 0) |
         (learns_lights ? static_cast<TraitBits>(Trait::kLearnedLights) : 0) |
         (settings.light_samples > 1 ? static_cast<TraitBits>(Trait::kLightSplits) : 0);
}

RenderPlan MakeRenderPlan(const SceneDescription& scene, const FrameSettings& settings);
// The plan as readable text: one line per effect, then the lights, notes and the variant.
std::string FormatRenderPlan(const RenderPlan& plan);

}  // namespace sheaf::render
