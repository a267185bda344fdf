// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light_pass.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>
#include <vector>

#include "common/base/cpu_clock.h"
#include "common/film/light/light_pass_accumulator.h"
#include "common/film/task_kind.h"
#include "worker/render/gather/gather_map.h"
#include "worker/render/guiding_training.h"
#include "worker/render/light_film.h"
#include "worker/render/light_tracer.h"
#include "worker/render/majorant_retries.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

// The pixel that the splat fell on; -1 where it has no place.
int32_t PixelAt(double raster) {
  constexpr double kMost = 1 << 30;
  return std::fabs(raster) < kMost ? static_cast<int32_t>(std::floor(raster)) : -1;
}

}  // namespace

absl::StatusOr<FilmTile> RenderLightPass(const CompiledScene& scene, PixelRect window,
                                         SampleBlock block, std::stop_token stop,
                                         RenderStats* stats) {
  if (scene.emission == nullptr) {
    return absl::InvalidArgumentError(
        "a light pass was requested of a frame that has paths from the camera alone; its "
        "techniques must be camera+light, light or others with light");
  }
  if (window.IsEmpty() || !IsAligned(block)) {
    return absl::InvalidArgumentError("a light pass needs a window with pixels and aligned passes");
  }
  if (absl::Status status = EnsureGuiding(scene, stop); !status.ok()) return status;
  const double start_seconds = ThreadCpuSeconds();
  const FrameSettings& settings = scene.settings;
  LightTracer tracer(scene, window);
  const auto goes_on = [&stop] { return !stop.stop_requested(); };
  const LightFilm film{window,
                       settings.width_px,
                       settings.height_px,
                       FilmEdgesOf(scene.description.camera),
                       &scene.filter,
                       LightOutputsOf(settings)};
  RayCounts counts;
  std::vector<LostSplat> lost;
  absl::StatusOr<FilmTile> tile;
  const uint32_t raised_majorants = RetryWithMajorants(scene.majorant_factor, &counts, [&] {
    lost.clear();
    tile = SumLightPasses(
        film, block,
        [&](uint64_t pass, SplatSink* splats) {
          return tracer.TracePass(pass, goes_on, splats, &counts)
                     ? absl::OkStatus()
                     : absl::CancelledError("the light pass was stopped");
        },
        &lost);
    return tile.ok();
  });
  if (!tile.ok() || stats == nullptr) return tile;
  stats->samples = block.count * static_cast<uint64_t>(settings.width_px) *
                   static_cast<uint64_t>(settings.height_px);
  stats->TakeCounts(scene, counts);
  stats->raised_majorants = raised_majorants;
  stats->cpu_seconds = ThreadCpuSeconds() - start_seconds;
  for (const LostSplat& splat : lost) {
    stats->non_finite.push_back({PixelAt(splat.raster.x), PixelAt(splat.raster.y), splat.pass});
  }
  return tile;
}

uint64_t LightPassMemoryBytes(PixelRect window, SampleBlock block, const FilmOutputs& outputs) {
  const uint64_t passes = std::min(block.count, LightPassAccumulator::kPassesMax);
  const uint64_t planes =
      kFilmChannelCount + passes * kReplicateChannelCount + 2 * MeanChannelCount(outputs);
  const uint64_t sums = static_cast<uint64_t>(std::bit_width(passes));
  const bool merges = HasMergeBias(outputs);
  const uint64_t values =
      3 * (1 + outputs.light_groups.size()) + (merges ? kMergeBiasMeanCount : 0);
  const uint64_t of_pixel = planes * sizeof(float) + sums * values * sizeof(double);
  const uint64_t gathered = merges ? GatherPointsMax(window, GatherStep(window.PixelCount())) : 0;
  return of_pixel * static_cast<uint64_t>(window.PixelCount()) + GatherMap::BytesMax(gathered);
}

}  // namespace sheaf::render
