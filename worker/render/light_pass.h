// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RenderLightPass: renders the frame's light passes, as RenderTilePass renders the passes of a
// tile.
#pragma once

#include <stop_token>

#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "worker/render/scene/compile_scene.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {

// Light passes > FilmTile: traces, for each pass of the block, one light path for each pixel of the
// whole frame, also where the window is a part of it, so that a crop equals that part of the whole.
// Sums what they splat onto the window. A pure function of (scene, window, block), as
// RenderTilePass is; densities above their bounds have the block rendered again. Single-threaded;
// may be called from any number of threads. Memory: about 110 bytes a pixel of the window for one
// pass, 450 for 16, and more with light groups (LightPassAccumulator), and some 400 bytes for each
// pixel with a camera path that light paths are merged with, at most kGatherPointsMax.
// Errors: kCancelled when stop was requested (checked once a row); kInvalidArgument.
absl::StatusOr<FilmTile> RenderLightPass(const CompiledScene& scene, PixelRect window,
                                         SampleBlock block, std::stop_token stop,
                                         RenderStats* stats);

// The memory that RenderLightPass takes at most, for its own sums and the camera paths that it
// stores. outputs: LightOutputsOf the frame's settings.
uint64_t LightPassMemoryBytes(PixelRect window, SampleBlock block, const FilmOutputs& outputs);

}  // namespace sheaf::render
