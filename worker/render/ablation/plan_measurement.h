// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What each effect of a plan costs in this scene, and what it gives: the scene is rendered as it is
// and without the effect, in turns.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "common/scene/settings/render_settings.h"

namespace sheaf::render {

// Of the seconds that a measurement may take.
inline constexpr double kMeasureSecondsMin = 0.1, kMeasureSecondsMax = 86400;

// A number and its standard error.
struct Measured {
  double value = 0, error = 0;
};

struct EffectMeasurement {
  std::string name;     // "lens", as in the plan; or "indirect light", "choice of lights".
  std::string without;  // How it was left out.
  std::string problem;  // Why nothing was measured; else empty.
  Measured time_ratio;  // CPU time of a sample with the effect over one without.
  // Of the picture without the effect, over that with it, minus 1: the mean of all channels.
  Measured mean_change;
  // Squared difference of the pictures, relative to the squared mean of the tile around the pixel
  // with the effect. Its expectation is that of noiseless pictures, so it may come out below 0.
  double rel_mse = 0;
  // Variance of a sample with the effect over one without, pixel by pixel.
  double variance_ratio = 1;
  uint64_t samples = 0;  // Per pixel of those rendered.

  // Share of the time that the effect takes.
  double TimeShare() const { return 1 - 1 / time_ratio.value; }
};

struct PlanMeasurement {
  double seconds = 0;  // In all.
  double microseconds_per_sample = 0;
  int64_t pixels = 0;  // Rendered, of the frame's: tiles spread evenly.
  std::vector<EffectMeasurement> effects;
};

// Measures the effects of the scene's plan in their order, then the light beyond the first
// scattering, half the depth, and the choice of lights where there are many. On the calling thread,
// but for building what rays are traced against. Takes `seconds`, and what one compiling of the
// scene takes at most; effects there was no time for say so. Errors: as CompileScene;
// kInvalidArgument where seconds is out of range.
absl::StatusOr<PlanMeasurement> MeasurePlan(const SceneDescription& scene,
                                            const FrameSettings& settings, FileSource& files,
                                            double seconds);

// As people read it: one line an effect. What noise hides is "none seen".
std::string FormatPlanMeasurement(const PlanMeasurement& measurement);

}  // namespace sheaf::render
