// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TilePass > samples > FilmTile.
#include "worker/render/tile_pass.h"

#include <algorithm>
#include <optional>
#include <utility>
#include <vector>

#include "common/base/check.h"
#include "common/base/cpu_clock.h"
#include "common/scene/settings/path_shares.h"
#include "common/volume/volume_pages.h"
#include "worker/render/chains/chain_variants.h"
#include "worker/render/eyes/eye_passes.h"
#include "worker/render/guiding_training.h"
#include "worker/render/integrator/variants.h"
#include "worker/render/majorant_retries.h"
#include "worker/render/mutations/mutation_passes.h"
#include "worker/render/scene/chain_table.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

// Samples between two looks at whether to stop: tens of milliseconds, at least a pixel.
constexpr uint64_t kSamplesToStopMax = 1 << 16;

// Calls render for each run of pixels of the tile's row that have samples of the block.
template <typename Render>
void RenderChosen(const PixelLattice& lattice, const PixelRect& tile, int32_t y, SampleBlock block,
                  const Render& render) {
  const int32_t stride = lattice.stride_px;
  for (int32_t cell_x = tile.x0 / stride; cell_x * stride < tile.x1; ++cell_x) {
    const PixelRect chosen = lattice.BlockOf(cell_x, y / stride);
    if (y < chosen.y0 || y >= chosen.y1) continue;
    const int32_t end = std::min(chosen.x1, tile.x1);
    for (int32_t x = std::max(chosen.x0, tile.x0); x < end;) {
      const int32_t begin = x;
      const PixelLattice::Part part = lattice.PartOf(x, y);
      while (x < end && lattice.PartOf(x, y) == part) ++x;
      const SampleBlock samples = lattice.SamplesOf(part, block);
      if (samples.count > 0) render(begin, x, samples);
    }
  }
}

RenderRowFunction RowFunctionFor(const CompiledScene& scene) {
  const bool generic = scene.settings.force_generic_variant;
  if (scene.chains != nullptr) {
    const size_t variant = ChooseChainVariant(scene.plan.traits, generic);
    scene.chains->EnsureSeeds([&] { return ChainSeedFunctionOf(variant)(scene); });
    return ChainRowFunctionOf(variant);
  }
  if (scene.emission == nullptr) return RowFunctionOf(ChooseVariant(scene.plan.traits, generic));
  return RowBesideLightOf(ChooseLightPathVariant(scene.plan.traits, generic));
}

// The passes of a frame whose paths or chains count in several pixels.
absl::StatusOr<FilmTile> RenderSharedTile(const CompiledScene& scene, PixelRect tile,
                                          SampleBlock block, const std::stop_token& stop,
                                          RenderStats* stats) {
  const FrameSettings& settings = scene.settings;
  if (!(tile == PixelRect{0, 0, settings.width_px, settings.height_px})) {
    return absl::InvalidArgumentError("a pass of shared paths is of the whole film");
  }
  const double start_seconds = ThreadCpuSeconds();
  RayCounts counts;
  std::vector<PixelAccumulator::NonFinite> lost;
  absl::StatusOr<FilmTile> film;
  const uint32_t raised_majorants = RetryWithMajorants(scene.majorant_factor, &counts, [&] {
    lost.clear();
    film =
        MutatesPaths(settings.techniques)
            ? RenderMutationPasses(scene, ChainRulesOf(scene, &counts), block, stop, &counts, &lost)
            : RenderEyePasses(scene, block, stop, &counts, &lost);
    return film.ok();
  });
  if (!film.ok() || stats == nullptr) return film;
  stats->samples = block.count * static_cast<uint64_t>(tile.PixelCount());
  stats->TakeCounts(scene, counts);
  stats->raised_majorants = raised_majorants;
  stats->cpu_seconds = ThreadCpuSeconds() - start_seconds;
  stats->non_finite = std::move(lost);
  return film;
}

}  // namespace

void RenderStats::TakeCounts(const CompiledScene& scene, const RayCounts& counts) {
  rays = counts.rays;
  shadow_rays = counts.shadow_rays;
  broken_nestings = counts.broken_nestings;
  if (counts.broken_shape < scene.description.shapes.size()) {
    broken_at =
        FormatLocation(scene.description, scene.description.shapes[counts.broken_shape].location);
  }
  broken_majorants = counts.broken_majorants;
  long_walks = counts.long_walks;
  long_segments = counts.long_segments;
  grazing_merges = counts.grazing_merges;
  chains = counts.chains;
  chain_trials = counts.chain_trials;
  capped_chains = counts.capped_chains;
  chain_moment = counts.chain_moment;
  unconnected_chain_moment = counts.unconnected_chain_moment;
  if (counts.capped_shape < scene.description.shapes.size()) {
    capped_at =
        FormatLocation(scene.description, scene.description.shapes[counts.capped_shape].location);
  }
}

absl::StatusOr<FilmTile> RenderTilePass(const CompiledScene& scene, PixelRect tile,
                                        SampleBlock block, std::stop_token stop,
                                        RenderStats* stats) {
  if (tile.Width() <= 0 || tile.Height() <= 0 || !IsAligned(block)) {
    return absl::InvalidArgumentError("a tile pass needs a tile with pixels and an aligned block");
  }
  if (HasOneTile(scene.settings)) return RenderSharedTile(scene, tile, block, stop, stats);
  if (absl::Status status = EnsureGuiding(scene, stop); !status.ok()) return status;
  const double start_seconds = ThreadCpuSeconds();
  const volume::PageCounts start_pages = volume::VolumePages::CountsOfThread();
  const RenderRowFunction render_row = RowFunctionFor(scene);
  const PixelLattice& lattice = scene.settings.lattice;
  std::optional<FilmTile> film;
  std::optional<PixelAccumulator> accumulator;
  RayCounts counts;
  bool stopped = false;
  // Returns at a stop: a row of many samples takes long.
  const auto render_run = [&](int32_t x0, int32_t x1, int32_t y, SampleBlock samples) {
    const auto step = static_cast<int32_t>(std::max<uint64_t>(
        1, std::min<uint64_t>(kSamplesToStopMax / samples.count, static_cast<uint64_t>(x1 - x0))));
    for (int32_t x = x0; x < x1; x += step) {
      stopped = stopped || stop.stop_requested();
      if (stopped) return;
      render_row(scene, x, std::min(x + step, x1), y, samples, &*accumulator, &counts);
    }
  };
  const uint32_t raised_majorants = RetryWithMajorants(scene.majorant_factor, &counts, [&] {
    film.emplace(tile, block, scene.settings.outputs);
    accumulator.emplace(&*film);
    for (int32_t y = tile.y0; y < tile.y1; ++y) {
      if (lattice.All()) {
        render_run(tile.x0, tile.x1, y, block);
      } else {
        RenderChosen(lattice, tile, y, block, [&](int32_t x0, int32_t x1, SampleBlock samples) {
          render_run(x0, x1, y, samples);
        });
      }
      if (stopped) return false;
    }
    return true;
  });
  if (stopped) return absl::CancelledError("the tile pass was stopped");
  if (scene.settings.outputs.HasIds()) scene.ids.NameAll(scene.description, &*film);
  if (stats != nullptr) {
    stats->samples = lattice.SampleCountIn(tile, block.count);
    stats->TakeCounts(scene, counts);
    stats->raised_majorants = raised_majorants;
    stats->cpu_seconds = ThreadCpuSeconds() - start_seconds;
    stats->non_finite = accumulator->non_finite();
    const volume::PageCounts pages = volume::VolumePages::CountsOfThread() - start_pages;
    stats->volume_pages = pages.pages_read;
    stats->volume_bytes = pages.bytes_read;
    stats->volume_waits = pages.waits;
  }
  return *std::move(film);
}

absl::Status CheckVolumes(const CompiledScene& scene) {
  return scene.media == nullptr ? absl::OkStatus() : scene.media->PageStatus();
}

}  // namespace sheaf::render
