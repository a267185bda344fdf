// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RayCounts: statistics of tracing, and the settings for a retry that they lead to.
#pragma once

#include <algorithm>
#include <cstdint>

namespace sheaf::render {

struct RayCounts {
  uint64_t rays = 0;  // Total.
  uint64_t shadow_rays = 0;
  // Number of times that surfaces did not enclose media as declared. Paths and shadow rays ended
  // where they left an unbounded medium that should be bounded, left a subsurface medium that they
  // had not entered, or entered more than kMediaAtOnceMax media. They continued where a
  // MediumInterface contradicts their set of media: CrossSides.
  uint64_t broken_nestings = 0;
  uint32_t broken_shape = ~0u;  // The first offending shape in the file; ~0u if unknown.
  void CountBroken(int32_t shape) {
    ++broken_nestings;
    broken_shape = std::min(broken_shape, static_cast<uint32_t>(shape));
  }
  // Number of densities above their majorant: if not 0, the image is biased.
  uint64_t broken_majorants = 0;
  // Factor of density bounds: not 1 where a block is rendered again because of broken_majorants.
  float majorant_factor = 1;
  uint64_t long_walks = 0;      // Paths that ended at kSubsurfaceStepsMax.
  uint64_t long_segments = 0;   // Paths and shadow rays that ended at kNullCrossingsMax.
  uint64_t grazing_merges = 0;  // Merges that were dropped: kGrazingCosineMin.
  // Chains of smooth interfaces that were found, and the trials that estimated with which
  // probability; and those that were dropped at kChainTrialsMax, which darkens the image.
  uint64_t chains = 0, chain_trials = 0, capped_chains = 0;
  uint32_t capped_shape = ~0u;  // The first shape whose light was dropped; ~0u if none.
  // Sums over the samples: the second moment that scattering would have by the light that chains
  // find; and the part of it at vertices that light paths cannot be connected with the camera.
  double chain_moment = 0, unconnected_chain_moment = 0;

  // Adds the counts of further rays, traced with the same settings.
  void Add(const RayCounts& others) {
    rays += others.rays;
    shadow_rays += others.shadow_rays;
    broken_nestings += others.broken_nestings;
    broken_shape = std::min(broken_shape, others.broken_shape);
    broken_majorants += others.broken_majorants;
    long_walks += others.long_walks;
    long_segments += others.long_segments;
    grazing_merges += others.grazing_merges;
    chains += others.chains;
    chain_trials += others.chain_trials;
    capped_chains += others.capped_chains;
    capped_shape = std::min(capped_shape, others.capped_shape);
    chain_moment += others.chain_moment;
    unconnected_chain_moment += others.unconnected_chain_moment;
  }
};

}  // namespace sheaf::render
