// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RenderEyePasses: the passes of a frame whose paths count in several pixels: of a stereo frame,
// and of one with Technique::kSharing. Pass n traces sample n of each pixel of all eyes. Each
// path counts for its own view and, shifted, for the others of its set (path_views.h), by the
// weights of shared_vertex.h: with kSharing in all pixels whose filters cover its points on the
// film, else its own point counts in its pixel alone. Weights assume that sample n exists in every
// pixel, so a pass is of the whole film.
//
// A pixel's sample is the sum of what paths bring to it, over the sum of their parts of a sample
// (SharedSample), which is 1 on average. Without that quotient, the number of paths that fall on a
// pixel would be noise, also where all of them bring the same.
#pragma once

#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "worker/render/integrator/ray_counts.h"
#include "worker/render/scene/compile_scene.h"

namespace sheaf::render {

// Renders the passes of the block over the frame's film, eyes side by side: a pure function of
// (scene, block). lost: receives samples that are not finite, at most
// PixelAccumulator::kNonFiniteReportsMax. Single-threaded. Memory: some 250 bytes a pixel of the
// film for one pass, 900 for 16 (EyePassMemoryBytes). Errors: kCancelled when stop was requested
// (checked once a row). Requires: HasOneTile(settings); IsAligned(block).
absl::StatusOr<FilmTile> RenderEyePasses(const CompiledScene& scene, SampleBlock block,
                                         const std::stop_token& stop, RayCounts* counts,
                                         std::vector<PixelAccumulator::NonFinite>* lost);

// The memory that RenderEyePasses takes at most, for a film of pixel_count pixels.
uint64_t EyePassMemoryBytes(int64_t pixel_count, SampleBlock block);

}  // namespace sheaf::render
