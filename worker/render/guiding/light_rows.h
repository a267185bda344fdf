// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LearnLightRows: what the regions of a scene learn from light samples that were tried there. A row
// has a factor for each light, where a scene weighs each light; else for the children of a cut of
// the light tree, which has more nodes where lights that are seen are beside lights that are
// hidden. Source of the idea: Vevoda, Kondapaneni and Krivanek 2018, "Bayesian online regression
// for adaptive direct illumination sampling"; of cuts that are learned, Wang et al. 2021,
// "Learning to cluster for rendering with many lights".
//
// A factor is the product of two, each against the same of the other children of the node: the part
// of the tries that were visible; and what these brought against what the choice had estimated.
// Factors have floors, and a part of all choices ignores them (LightChoice), so each light that may
// shine keeps a probability.
#pragma once

#include <cstdint>
#include <vector>

#include "worker/render/light/choice/light_choice.h"
#include "worker/render/light/choice/light_visibility.h"

namespace sheaf::render {

// Estimates and contributions are counted in units of 1 / kLightTryUnit. Larger ones count as
// kLightTryMax, so that one bright try does not decide; 2^40 of them fit in a sum.
inline constexpr double kLightTryUnit = 0x1p16, kLightTryMax = 16;
// A node joins a cut only where it has kCutTriesMin tries, kCutGainMin of which were seen or hidden
// otherwise than the mean of its children tells, and more than chance would make it.
inline constexpr uint64_t kCutTriesMin = 8, kCutGainMin = 2;
// The part of the tries that is visible is learned against this many tries of which as large a part
// was visible as of all tries at the node. A fixed part would be a bet on lights that were rarely
// tried, and most of a large scene's lights are rarely tried in a region.
inline constexpr double kVisiblePrior = 1;
// The light that visible tries brought is learned against this many tries that brought as much as
// the mean of the node, and makes a factor of at most kContributionFactorMax, at least its inverse.
inline constexpr double kContributionPrior = 8, kContributionFactorMax = 4;

struct LightTry {
  uint32_t region = 0;
  uint32_t light = 0;
  // The light's part of the choice's estimate, over the probability of the light.
  uint32_t estimate = 0;
  // The light that the try brought, over the estimate of all lights; 0 where it was hidden.
  uint32_t contribution = 0;
  bool is_visible = false;
};

// Knows nothing where there is no choice of lights. Requires: regions below region_count, which is
// at most kLightVisibilityRegionsMax; lights of the choice; fewer than 2^32 tries.
LightVisibility LearnLightRows(const LightChoice& choice, uint32_t region_count,
                               std::vector<LightTry> tries);

}  // namespace sheaf::render
