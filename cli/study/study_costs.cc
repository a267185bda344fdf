// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_costs.h"

#include <chrono>

#include "cli/study/light_passes.h"
#include "cli/study/study_tiles.h"
#include "coordinator/core/job/job.h"

namespace sheaf::cli {
namespace {

using CostClock = std::chrono::steady_clock;

// Renders twice, as the first run warms caches; returns the wall seconds of the second.
template <typename Render>
absl::StatusOr<double> TimeSecond(const Render& render) {
  double seconds = 0;
  for (int i = 0; i < 2; ++i) {
    const CostClock::time_point begin = CostClock::now();
    if (absl::Status status = render(); !status.ok()) return status;
    seconds = std::chrono::duration<double>(CostClock::now() - begin).count();
  }
  return seconds;
}

}  // namespace

absl::StatusOr<StudyCosts> MeasureCosts(double minutes, int threads,
                                        const std::vector<StudySetting>& ladder,
                                        StudyScenes* scenes, StudyScene* base) {
  const FrameSettings& settings = SettingsOf(*base->frame);
  StudyCosts costs;
  costs.minutes = minutes;
  costs.tile_count = CutTiles(settings.window, kStudyTilePx).size();
  costs.frame_pixels = coordinator::PathsPerLightPass(settings);
  for (const StudySetting& setting : ladder) {
    if (setting.clamp_means != 0) continue;
    ++costs.setting_count;
    if (HasLightPaths(setting.settings.techniques)) ++costs.light_setting_count;
  }
  const std::vector<PixelRect> tiles = ChooseTiles(settings.window, kStudyTilesMin);
  TileRenderer trial(*base->frame, tiles, threads);
  const absl::StatusOr<double> of_block = TimeSecond([&] { return trial.RenderBlock(); });
  if (!of_block.ok()) return of_block.status();
  costs.seconds_per_tile = *of_block / static_cast<double>(tiles.size());
  if (costs.light_setting_count == 0) return costs;
  const double pixels = double{kStudyTilesMin} * kStudyTilePx * kStudyTilePx;
  absl::Status status = scenes->CompileSmall(ShrinkTo(pixels, costs.frame_pixels), {}, base);
  if (!status.ok()) return status;
  LightPasses passes(*base->light(), threads);
  const absl::StatusOr<double> of_passes =
      TimeSecond([&] { return passes.RenderUntil(passes.count() + kStudyBlockSamples); });
  if (!of_passes.ok()) return of_passes.status();
  const int64_t paths = coordinator::PathsPerLightPass(SettingsOf(*base->light()));
  costs.seconds_per_light_path = *of_passes / static_cast<double>(kStudyBlockSamples * paths);
  return costs;
}

}  // namespace sheaf::cli
