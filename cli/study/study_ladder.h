// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The ladder of a study: the settings to render a scene with, each one step away from the given
// settings.
#pragma once

#include <string>
#include <vector>

#include "common/scene/settings/render_settings.h"
#include "worker/render/plan/render_plan.h"
#include "worker/render/tile_pass.h"

namespace sheaf::cli {

struct StudySetting {
  std::string name;  // "depth 2".
  std::string how;   // In words.
  std::string flag;  // The option that selects it: "--max-depth 2". Empty if there is none.
  FrameSettings settings;
  render::CompileTechniques techniques;
  bool is_base = false;
  bool is_unbiased = true;       // Relative to the given settings: images differ by noise only.
  bool is_truer = false;         // If biased: it includes light that the given settings omit.
  bool keeps_error_bars = true;  // False if it gives up the true error bars of the base.
  bool is_without_light_paths = false;  // The given settings without their light paths.
  bool stops_tiles = false;             // Tiles get samples in rounds, as with --target-error.
  // Samples of the base are clamped to this many times the image's mean; 0: no clamping.
  double clamp_means = 0;
};

// The first setting is the base. Settings that would change nothing in this scene are omitted.
std::vector<StudySetting> MakeLadder(const FrameSettings& settings, const render::RenderPlan& plan);
// Settings that users may expect but that this study omits, with the reasons: one line each.
std::vector<std::string> MissingLadders(const FrameSettings& settings,
                                        const render::RenderPlan& plan);

}  // namespace sheaf::cli
