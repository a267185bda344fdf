// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// MeasurePlan: the cost of each effect of a plan in this scene, and its benefit: renders the scene
// and its ablations in alternating turns.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::render {

// Range of the seconds that a measurement may take.
inline constexpr double kMeasureSecondsMin = 0.1, kMeasureSecondsMax = 86400;

// A number and its standard error.
struct Measured {
  double value = 0, error = 0;
};

struct EffectMeasurement {
  std::string name;      // "lens", as in the plan; or "indirect light", "choice of lights".
  std::string ablation;  // How the effect was ablated.
  std::string problem;   // Why there is no measurement; else empty.
  Measured time_ratio;   // CPU time per sample with the effect over the time without.
  // Image without the effect over the image with it, minus 1: the mean of all channels.
  Measured mean_change;
  // Squared difference of the images, relative to the squared mean, with the effect, of the tile
  // around the pixel. Its expectation is that of noise-free images, so it may be below 0.
  double relative_mse = 0;
  // Variance of a sample with the effect over the variance without, pixel by pixel.
  double variance_ratio = 1;
  uint64_t samples = 0;  // Per rendered pixel.

  // Fraction of the time that the effect takes.
  double TimeFraction() const { return 1 - 1 / time_ratio.value; }
};

struct PlanMeasurement {
  double seconds = 0;  // Total.
  double microseconds_per_sample = 0;
  int64_t pixels = 0;  // Number of pixels rendered, in tiles spread evenly over the frame.
  std::vector<EffectMeasurement> effects;
};

// Measures the effects of the scene's plan in their order, then light beyond the first scattering
// event, half the depth, and light selection if there are many lights. Runs on the calling thread,
// except for building the acceleration structure. Takes `seconds` plus at most the time of
// compiling the scene once; effects that got no time are marked. Requires: the settings' techniques
// have no light paths. Errors: as CompileScene; kInvalidArgument where seconds is out of range.
absl::StatusOr<PlanMeasurement> MeasurePlan(const SceneDescription& scene,
                                            const FrameSettings& settings, FileSource& files,
                                            double seconds);

// Readable text: one line per effect. Values hidden by noise read "none seen".
std::string FormatPlanMeasurement(const PlanMeasurement& measurement);

}  // namespace sheaf::render
