// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RenderEyePasses: the passes of a stereo frame. Pass n traces sample n of each pixel of both eyes.
// Each path counts in its own pixel, and, shifted to the other eye, in the pixels there whose
// filters cover it, by the weights of other_eye.h. Weights assume that both eyes have sample n in
// every pixel, so a pass is of the whole film.
//
// A pixel's sample is the sum of what its own path and shifted ones bring, over the sum of their
// parts of a sample (EyeSample::own_share), which is 1 on average. Without that quotient, the
// number of shifted paths that fall on a pixel would be noise, also where all of them bring the
// same.
#pragma once

#include <stop_token>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "worker/render/integrator/ray_counts.h"
#include "worker/render/scene/compile_scene.h"

namespace sheaf::render {

// Renders the passes of the block over the frame's film, both eyes side by side: a pure function of
// (scene, block). lost: receives samples that are not finite, at most
// PixelAccumulator::kNonFiniteReportsMax. Single-threaded. Memory: some 250 bytes a pixel of the
// film for one pass, 900 for 16 (EyePassMemoryBytes). Errors: kCancelled when stop was requested
// (checked once a row). Requires: a stereo scene; IsAligned(block).
absl::StatusOr<FilmTile> RenderEyePasses(const CompiledScene& scene, SampleBlock block,
                                         const std::stop_token& stop, RayCounts* counts,
                                         std::vector<PixelAccumulator::NonFinite>* lost);

// The memory that RenderEyePasses takes at most, for a film of pixel_count pixels.
uint64_t EyePassMemoryBytes(int64_t pixel_count, SampleBlock block);

}  // namespace sheaf::render
