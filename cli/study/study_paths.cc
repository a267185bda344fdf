// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "cli/study/study_paths.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "cli/study/light_passes.h"
#include "cli/study/study_tiles.h"
#include "common/film/error/mean_interval.h"

namespace sheaf::cli {
namespace {

using PathClock = std::chrono::steady_clock;

// Every eighth tile first, so that those that fit into the time are spread over the frame.
size_t Interleaved(size_t i, size_t count) {
  constexpr size_t kStride = 8;
  for (size_t first = 0; first < kStride; ++first) {
    const size_t in_turn = (count + kStride - 1 - first) / kStride;
    if (i < in_turn) return first + i * kStride;
    i -= in_turn;
  }
  return 0;
}

void NoteUnreliable(const PixelRect& tile, const render::PathNoise& noise, StudyPaths* paths) {
  if (noise.one_replicate_fraction <= kOneReplicateMax) return;
  const auto worst =
      std::max_element(noise.kinds.begin(), noise.kinds.end(),
                       [](const auto& a, const auto& b) { return a.variance < b.variance; });
  paths->unreliable_tiles.push_back(
      {tile, static_cast<LightPathKind>(worst - noise.kinds.begin()), worst->variance});
}

}  // namespace

absl::StatusOr<StudyPaths> MeasurePathNoise(const StudyScene& scene,
                                            const std::vector<PixelRect>& tiles, double mean,
                                            int threads, double seconds) {
  absl::StatusOr<render::PathSums> light_sums;
  render::LightBeside light;
  if (scene.light() != nullptr) {
    light_sums = render::SumLightPaths(*scene.light(), kPathSamples, threads);
    if (!light_sums.ok()) return light_sums.status();
    const FrameSettings& of_frame = SettingsOf(*scene.frame);
    const FrameSettings& of_light = SettingsOf(*scene.light());
    light = {&*light_sums, [&of_frame, &of_light](int32_t x, int32_t y) {
               return IndexInPlace(of_light.window, of_light.width_px, of_light.height_px, x, y,
                                   of_frame.width_px, of_frame.height_px);
             }};
  }
  std::vector<render::PathNoiseSums> of_tiles(tiles.size());
  std::vector<char> done(tiles.size());
  const auto until = PathClock::now() + std::chrono::duration<double>(seconds);
  const absl::Status status = ForEachTile(threads, tiles.size(), [&](size_t i) {
    const size_t tile = Interleaved(i, tiles.size());
    if (i > 0 && PathClock::now() > until) return absl::OkStatus();
    absl::StatusOr<render::PathNoiseSums> sums =
        render::PathNoiseSums::Of(*scene.frame, tiles[tile], kPathSamples, 0.1 * 3 * mean, light);
    if (!sums.ok()) return sums.status();
    of_tiles[tile] = *std::move(sums);
    done[tile] = 1;
    return absl::OkStatus();
  });
  if (!status.ok()) return status;
  StudyPaths paths;
  render::PathNoiseSums all;
  for (size_t tile = 0; tile < tiles.size(); ++tile) {
    if (done[tile] == 0) continue;
    ++paths.assessed_tile_count;
    all.Add(of_tiles[tile]);
    NoteUnreliable(tiles[tile], of_tiles[tile].Fractions(), &paths);
  }
  const render::PathNoise noise = all.Fractions();
  for (size_t k = 0; k < kLightPathKindCount; ++k) {
    if (noise.kinds[k].light == 0) continue;
    paths.paths.push_back({static_cast<LightPathKind>(k), noise.kinds[k]});
  }
  return paths;
}

}  // namespace sheaf::cli
