// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The renderer's public interface: CompileScene and RenderTilePass. No gRPC, no protobuf.
#pragma once

#include <cstdint>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "worker/render/scene/compile_scene.h"

namespace sheaf::render {

struct RayCounts;

struct RenderStats {
  uint64_t samples = 0;
  uint64_t rays = 0;  // All rays traced: camera, scattered and shadow.
  uint64_t shadow_rays = 0;
  uint64_t broken_nestings = 0;  // As in RayCounts.
  std::string broken_at;         // Location of such a shape in the scene file; empty: unknown.
  uint64_t long_walks = 0;       // Paths that ended at the limit: RayCounts.
  uint64_t long_segments = 0;    // Likewise.
  uint64_t grazing_merges = 0;   // Merges that were dropped: RayCounts.
  // As in RayCounts; capped_at: location of the first lamp whose light was dropped.
  uint64_t chains = 0, chain_trials = 0, capped_chains = 0;
  std::string capped_at;
  double chain_moment = 0, unconnected_chain_moment = 0;  // RayCounts.
  uint64_t broken_majorants = 0;  // Remaining biased lookups: RayCounts.
  uint32_t raised_majorants = 0;  // Times the block was rendered again because of them.
  // Pages of volumes that this pass read, their bytes in files, and waits for other threads.
  uint64_t volume_pages = 0, volume_bytes = 0, volume_waits = 0;
  double cpu_seconds = 0;
  // For light passes: of splats, by the pixel they fell on and their pass.
  std::vector<PixelAccumulator::NonFinite> non_finite;

  // Sets the members that `counts` has.
  void TakeCounts(const CompiledScene& scene, const RayCounts& counts);
};

// TilePass > FilmTile: renders every sample of the block in every pixel of the tile. A pure
// function of (scene, tile, block): if a density violates its bounds, the whole block is rendered
// again with raised bounds. Single-threaded; may be called from any number of threads. The tile of
// a stereo frame is its whole film (eyes/eye_passes.h, which states its memory). Errors: kCancelled
// when stop was requested (checked once a row).
absl::StatusOr<FilmTile> RenderTilePass(const CompiledScene& scene, PixelRect tile,
                                        SampleBlock block, std::stop_token stop,
                                        RenderStats* stats);

// The first error of reading a volume while anything of the scene was rendered: what was rendered
// since is wrong. Errors: kInvalidArgument.
absl::Status CheckVolumes(const CompiledScene& scene);

}  // namespace sheaf::render
