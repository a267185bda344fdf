// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RenderMutationPasses: the passes of a frame with Technique::kMutations. Pass n traces sample n of
// each pixel, and spreads bright samples over chains of mutations (mutation_row.h). Chains reach
// pixels far from their own, so a pass is of the whole film. All of a pass counts in the replicate
// of its samples, so error bars of pixels stay true.
//
// A pixel's sample is what its own path brings, and what all chains of the pass deposit in it.
#pragma once

#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "worker/render/integrator/ray_counts.h"
#include "worker/render/mutations/mutation_variants.h"
#include "worker/render/scene/compile_scene.h"

namespace sheaf::render {

// The rules of the frame: thresholds by the medians of means of a pilot, which traces a path for
// each of 16 pixels with numbers of its own. A pure function of the scene: thresholds do not depend
// on the samples that they split, which keeps the image unbiased. No sample starts chains where the
// pilot finds the whole film black. counts: receives the pilot's rays.
ChainRules ChainRulesOf(const CompiledScene& scene, RayCounts* counts);

// Renders the passes of the block over the frame's film: a pure function of (scene, rules, block).
// lost: receives samples that are not finite, at most PixelAccumulator::kNonFiniteReportsMax.
// Single-threaded. Memory: at most that of EyePassMemoryBytes. Errors: kCancelled when stop was
// requested (checked once a row). Requires: the frame's technique is kMutations; rules: of the
// scene; IsAligned(block).
absl::StatusOr<FilmTile> RenderMutationPasses(const CompiledScene& scene, const ChainRules& rules,
                                              SampleBlock block, const std::stop_token& stop,
                                              RayCounts* counts,
                                              std::vector<PixelAccumulator::NonFinite>* lost);

}  // namespace sheaf::render
