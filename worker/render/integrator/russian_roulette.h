// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Russian roulette: ends paths of low throughput at random, without bias. Where a field knows that
// a path of low throughput has come to where the light is, the path continues: its light is what
// the samples of a dark pixel wait for. Source of the idea, there with fewer survivors too: Vorba
// and Krivanek 2016, "Adjoint-Driven Russian Roulette and Splitting in Light Transport Simulation".
#pragma once

#include <algorithm>
#include <cmath>

#include "worker/render/integrator/context.h"

namespace sheaf::render {

// False where the path ends. u: uniform.
template <typename C>
bool SurvivesRoulette(const Context<C>& c, float u, PathState<C>* path) {
  // The square root ends fewer of the paths that bring light to dark places, where relative errors
  // are largest: a tenth more rays, a fifth to a half less relMSE.
  float survival = std::sqrt(MaxComponent(path->throughput) * path->roulette_scale);
  if constexpr (C::kGuided && !C::kFromLight) {
    survival = std::max(survival, std::sqrt(path->guided.expected_light));
  }
  bool may_end = path->depth > c.scene.roulette_depth_min;
  if constexpr (C::kSubsurface) may_end = may_end || path->media.properties.is_subsurface;
  if (survival < 1 && may_end) {
    const float stop = std::min(kRouletteStopMax, 1 - survival);
    if (u < stop) return false;
    path->throughput *= 1 / (1 - stop);
  }
  return true;
}

}  // namespace sheaf::render
