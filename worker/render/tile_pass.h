// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The renderer as everyone else sees it: CompileScene and RenderTilePass. No gRPC, no protobuf.
#pragma once

#include <cstdint>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "worker/render/scene/compile_scene.h"

namespace sheaf::render {

struct RenderStats {
  uint64_t samples = 0;
  uint64_t rays = 0;  // All rays traced: camera, scattered and shadow.
  uint64_t shadow_rays = 0;
  uint64_t broken_nestings = 0;   // RayCounts.
  std::string broken_at;          // Where the scene file has a shape with such; empty: unknown.
  uint64_t long_walks = 0;        // Paths that ended for them: RayCounts.
  uint64_t broken_majorants = 0;  // Biased look-ups that are left: RayCounts.
  uint32_t raised_majorants = 0;  // Times that the block was rendered again for such look-ups.
  double cpu_seconds = 0;
  std::vector<PixelAccumulator::NonFinite> non_finite;
};

// TilePass > FilmTile: renders every sample of the block in every pixel of the tile. A pure
// function of (scene, tile, block): where a density is found beyond its bounds, all of the block is
// rendered again with bounds that are raised. Single-threaded; call from as many threads as wanted.
// Errors: kCancelled when stop was requested (checked once a row).
absl::StatusOr<FilmTile> RenderTilePass(const CompiledScene& scene, PixelRect tile,
                                        SampleBlock block, std::stop_token stop,
                                        RenderStats* stats);

}  // namespace sheaf::render
