// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The renderer as everyone else sees it: CompileScene and RenderTilePass. No gRPC, no protobuf.
#pragma once

#include <cstdint>
#include <memory>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "common/film/film_tile.h"
#include "common/scene/file_source.h"
#include "common/scene/render_settings.h"
#include "common/scene/scene_description.h"
#include "worker/render/path_limits.h"
#include "worker/render/render_plan.h"

namespace sheaf::render {

struct CompileLimits {
  uint64_t texture_cache_bytes_max = uint64_t{512} << 20;
  uint32_t build_threads = 0;  // 0: as many as the machine has.
  // Of all displaced meshes together; each takes some 150 bytes while it is made, 60 afterwards.
  uint64_t displaced_triangles_max = uint64_t{1} << 24;
};

// Whether light is gathered along lines through media that vary.
enum class LinesInVarying : uint8_t { kWhereItPays, kAlways, kNever };

// Choices that change the noise of a picture and not its expectation; tests compare the techniques
// with each other.
struct CompileTechniques {
  bool choose_lights_evenly = false;  // Instead of by what each may send to a point.
  bool bound_media_once = false;      // One bound for all of a medium, not one where it is dense.
  LinesInVarying lines_in_varying = LinesInVarying::kWhereItPays;
  // Roulette may end paths on surfaces after more than so many scatterings.
  uint32_t roulette_depth_min = kRouletteDepthMin;
  // What bounds of densities are multiplied by. Below 1 they are wrong, which rendering must find.
  float majorant_factor = 1;
};

// Immutable after CompileScene; all const members may be used from many threads at once.
class CompiledScene;
struct CompiledSceneDeleter {
  void operator()(const CompiledScene* scene) const;
};
using CompiledScenePtr = std::unique_ptr<const CompiledScene, CompiledSceneDeleter>;

// SceneDescription + RenderPlan > CompiledScene. Takes the description by value: its mesh buffers
// are handed to the ray tracer without a copy.
// Errors: kInvalidArgument with the location in the scene file; kResourceExhausted over a limit.
absl::StatusOr<CompiledScenePtr> CompileScene(SceneDescription scene, const FrameSettings& settings,
                                              FileSource& files, const CompileLimits& limits = {},
                                              const CompileTechniques& techniques = {});
const RenderPlan& PlanOf(const CompiledScene& scene);
const FrameSettings& SettingsOf(const CompiledScene& scene);
uint64_t MemoryBytesOf(const CompiledScene& scene);

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
