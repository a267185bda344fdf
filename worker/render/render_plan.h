// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SceneDescription > RenderPlan: which effects the scene calls for, who asked, and which compiled
// variant of the integrator serves them. What is not in the plan is not run.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/scene/render_settings.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

// One bit each. A variant compiled with fewer traits runs no code for the others.
enum class Trait : uint32_t {
  kMotion = 1u << 0,                // Animated transforms within an open shutter.
  kLens = 1u << 1,                  // Lens radius > 0, or a realistic lens.
  kTextures = 1u << 2,              // Image textures or procedural ones.
  kEnvironment = 1u << 3,           // Infinite lights.
  kDeltaLights = 1u << 4,           // Lights without size.
  kAreaLights = 1u << 5,            // Emissive shapes.
  kSpecularTransmission = 1u << 6,  // Dielectrics, diffuse transmission.
  kLayered = 1u << 7,               // Coated materials.
  kMicrofacet = 1u << 8,            // Rough or smooth conductors, rough coats.
  kAlpha = 1u << 9,                 // Cut-outs, interfaces, stochastic mixes.
  kInstances = 1u << 10,            // Object instances.
  kQuadrics = 1u << 11,             // Shapes met in double: quadrics, bilinear patches.
  kSpectral = 1u << 12,             // Four wavelengths a path instead of RGB.
  kHair = 1u << 13,                 // Fibres: light goes through them whatever their normals.
  kMeasured = 1u << 14,             // Reflection as measured, in files.
  kCurves = 1u << 15,               // Shapes that are curves with a width.
  kNormalMaps = 1u << 16,           // Normal and bump maps.
  kVaryingEmission = 1u << 17,      // Emissive shapes with a picture or a cut-out.
  kOutputs = 1u << 18,              // More than the picture: FilmOutputs.
  kMedia = 1u << 19,                // Participating media.
  kHeterogeneousMedia = 1u << 20,   // Some that are not the same everywhere.
  kChromaticMedia = 1u << 21,       // Some that absorb or scatter some colours more than others.
  kEmissiveMedia = 1u << 22,        // Some that shine.
  kDeformation = 1u << 23,          // Meshes whose vertices move within an open shutter.
  kSubsurface = 1u << 24,           // Matter that scatters light beneath its surface.
  kNestedDielectrics = 1u << 25,    // Matter that overlaps, by priority.
  kMovingVolumes = 1u << 26,        // Media that velocities move within an open shutter.
};
inline constexpr int kTraitCount = 27;

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
