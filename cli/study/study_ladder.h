// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The ladder of a study: the settings that a scene is rendered with, each one step from those
// given.
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
  std::string flag;  // By which people choose it: "--max-depth 2". Empty where they cannot.
  FrameSettings settings;
  render::CompileTechniques techniques;
  bool is_base = false;
  bool is_unbiased = true;   // Against the given settings: pictures differ by noise alone.
  bool is_truer = false;     // Of what is not unbiased: the settings given leave out what this has.
  bool stops_tiles = false;  // Tiles get samples by rounds, as with --target-error.
  // Samples of the base are cut at so many times the picture's mean; 0: they are not.
  double clamp_means = 0;
};

// The first is the base. Settings that would change nothing in this scene are left out.
std::vector<StudySetting> MakeLadder(const FrameSettings& settings, const render::RenderPlan& plan);
// What people may look for and the ladder has not, and why: a line each.
std::vector<std::string> WhatLaddersLack(const render::RenderPlan& plan);

}  // namespace sheaf::cli
