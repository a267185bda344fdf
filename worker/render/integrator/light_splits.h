// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Several light samples at a vertex: the lights are split there into parts (LightChoice::CutAt),
// and each part gives one sample. Source: Conty Estevez and Kulla 2018, "Importance Sampling of
// Many Lights with Adaptive Tree Splitting". docs/adr/0070.
//
// Weights. The samples of different parts are techniques of their own. A light is in one part at
// most, so a point of it is found by the sample of that part, with density p: its probability
// within the part, times the density of the point. All other parts have density 0 there. Scattering
// finds it with density q. The weights of the two are those of a vertex with a single light sample,
// with p for the density of that: p^2 / (p^2 + q^2) and q^2 / (p^2 + q^2), which sum to 1. A light
// in no part has p = 0, and scattering alone finds it.
//
// Only vertices on surfaces split the lights. In media, line sampling weighs itself against a
// single sample. A light path learns the number of its first vertex, from the camera, where it is
// connected to the camera: it carries the densities for each number (SampledByParts).
#pragma once

#include <algorithm>
#include <cstdint>

#include "common/scene/settings/render_settings.h"
#include "worker/render/integrator/context.h"
#include "worker/render/integrator/guided_directions.h"
#include "worker/render/light/choice/light_choice.h"

namespace sheaf::render {

static_assert(kLightSamplesMax == LightChoice::kPartsMax);

// The limit halves with each scattering, as later vertices matter less and are more numerous: with
// all of them, a path takes fewer than twice the samples of its first vertex more than it has
// vertices. vertex: its index for sample dimensions.
inline uint32_t LightSamplesAt(int32_t limit, uint32_t vertex) {
  constexpr uint32_t kHalvingsMax = 31;
  const auto samples = static_cast<uint32_t>(std::max(1, limit));
  return std::max(1u, samples >> std::min(vertex, kHalvingsMax));
}

// The limit at the path's last vertex.
template <typename C>
StateIf<C::kSplitsLights, LightSplitState> LightSplitsAt(
    [[maybe_unused]] const Context<C>& c, [[maybe_unused]] const PathState<C>& path) {
  if constexpr (C::kSplitsLights) {
    if (!c.scene.lights->choice().splits()) return {};
    return {LightSamplesAt(c.scene.settings.light_samples, LastVertexIndex(path))};
  }
  return {};
}

// By which the path's last vertex sampled lights.
template <typename C>
LightQuery LightQueryAtLast(const PathState<C>& path) {
  LightQuery query = LightsFromLast<C>(path);
  if constexpr (C::kSplitsLights) query.samples_max = path.splits.samples_max;
  if constexpr (C::kProduct) query.sketch = path.sketch.OrNull();
  return query;
}

}  // namespace sheaf::render
