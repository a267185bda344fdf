// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneDescription > RenderPlan: which effects the scene calls for, who asked, and which compiled
// variant of the integrator serves them. What is not in the plan is not run.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

struct PlannedEffect {
  Trait trait{};
  std::string name;   // "lens"
  std::string cause;  // "scenes/room.pbrt:12:1: Camera \"float lensradius\" [0.05]"
  // Time of a sample with the effect over one without, in the small scene of this effect that
  // tests/bench/effect_cost.py measures; 0 where it has none. What it is in this one says
  // MeasurePlan.
  double expected_time_ratio = 1;
};
struct RenderPlan {
  uint32_t traits = 0;          // The scene's.
  uint32_t variant_traits = 0;  // Of the compiled variant: a superset of traits.
  std::string variant_name;
  // The settings', or less where no light can come by more scattering: then deeper paths would all
  // bring exactly nothing.
  int32_t max_depth = 0;
  std::string depth_cause;             // Of a smaller one; else empty.
  size_t light_count = 0;              // Of emissive triangles, spheres, disks and other lights.
  std::vector<PlannedEffect> effects;  // In the order of Trait.
  std::vector<std::string> unused;     // Names of the effects that cost nothing here.
  // What else whoever sees the picture should know: a line each.
  std::vector<std::string> notes;
};

RenderPlan MakeRenderPlan(const SceneDescription& scene, const FrameSettings& settings);
// The plan as people read it: one line an effect, then the lights, notes and the variant.
std::string FormatRenderPlan(const RenderPlan& plan);

}  // namespace sheaf::render
