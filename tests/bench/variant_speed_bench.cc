// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// variant_speed_bench FOLDER [MIN_MEDIAN]: what the choice of a variant gains. Every scene below
// the folder that Sheaf reads is rendered by the variant its plan chooses and by the generic one,
// in turns on one thread; the pictures must be equal to the bit. Prints the ratio of their times
// (the generic one's over the chosen one's, by the CPU time of the thread) for each scene, and the
// median of all. Exits with 1 where pictures differ or the median is below MIN_MEDIAN. Without a
// FOLDER, with an empty name or one that is not there, it says so and has nothing to do.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "common/film/tile_geometry.h"
#include "common/scene/render_settings.h"
#include "common/scene/scene_reader.h"
#include "worker/render/compiled_scene.h"
#include "worker/render/tile_pass.h"
#include "worker/render/variants.h"

namespace sheaf::render {
namespace {

constexpr int kRounds = 9;
constexpr int32_t kTileSizePx = 16;
constexpr size_t kTilesMax = 48;  // Spread evenly over the frame.
constexpr uint64_t kSamples = 4;

double CpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

FilmTile Render(const CompiledScene& scene, const PixelRect& rect, size_t variant) {
  FilmTile tile(rect, {0, kSamples});
  PixelAccumulator accumulator(&tile);
  RayCounts counts;
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    RowFunctionOf(variant)(scene, rect.x0, rect.x1, y, {0, kSamples}, &accumulator, &counts);
  }
  return tile;
}

std::vector<PixelRect> TilesOf(const PixelRect& window) {
  const std::vector<PixelRect> all = CutTiles(window, kTileSizePx);
  const size_t step = (all.size() + kTilesMax - 1) / kTilesMax;
  std::vector<PixelRect> tiles;
  for (size_t i = 0; i < all.size(); i += step) tiles.push_back(all[i]);
  return tiles;
}

struct Result {
  double ratio = 1;
  bool equal = true;
};

Result Measure(const CompiledScene& scene) {
  const size_t chosen = ChooseVariant(scene.plan.traits, false);
  const size_t generic = ChooseVariant(scene.plan.traits, true);
  const std::vector<PixelRect> tiles = TilesOf(scene.settings.window);
  std::vector<double> ratios;
  Result result;
  for (int round = 0; round <= kRounds; ++round) {
    double seconds[2] = {0, 0};
    // Tile by tile, so that both see the same moments of the machine; the order changes too.
    for (size_t i = 0; i < tiles.size(); ++i) {
      const bool generic_first = (i + static_cast<size_t>(round)) % 2 == 0;
      const double start = CpuSeconds();
      const FilmTile first = Render(scene, tiles[i], generic_first ? generic : chosen);
      const double middle = CpuSeconds();
      const FilmTile second = Render(scene, tiles[i], generic_first ? chosen : generic);
      const double end = CpuSeconds();
      seconds[generic_first ? 0 : 1] += middle - start;
      seconds[generic_first ? 1 : 0] += end - middle;
      result.equal = result.equal && first == second;
    }
    if (round > 0) ratios.push_back(seconds[0] / seconds[1]);  // The first one warms caches.
  }
  std::sort(ratios.begin(), ratios.end());
  result.ratio = ratios[ratios.size() / 2];
  return result;
}

// None where Sheaf does not render the file: fragments of scenes, media.
std::optional<Result> MeasureFile(const std::filesystem::path& path) {
  DirectoryFileSource files(path.parent_path().string());
  auto read = ReadScene(path.filename().string(), files);
  absl::Status status = read.status();
  if (status.ok()) {
    const auto settings = ResolveSettings(read->scene, {});
    status = settings.status();
    if (status.ok()) {
      auto scene = CompileScene(std::move(read->scene), *settings, files);
      status = scene.status();
      if (status.ok()) {
        const Result result = Measure(**scene);
        std::printf("%-36s %-34s ratio %.3f%s\n", path.filename().c_str(),
                    (*scene)->plan.variant_name.c_str(), result.ratio,
                    result.equal ? "" : ", PICTURES DIFFER");
        std::fflush(stdout);
        return result;
      }
    }
  }
  const std::string reason(status.message());
  std::printf("%-36s not rendered: %s\n", path.filename().c_str(),
              reason.substr(0, reason.find('\n')).c_str());
  return std::nullopt;
}

int Run(const std::string& folder, double median_min) {
  std::error_code error;
  if (folder.empty() || !std::filesystem::is_directory(folder, error)) {
    std::printf("no folder of scenes \"%s\": nothing to compare\n", folder.c_str());
    return 0;
  }
  std::vector<std::filesystem::path> paths;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder, error)) {
    if (entry.path().extension() == ".pbrt") paths.push_back(entry.path());
  }
  std::sort(paths.begin(), paths.end());
  std::vector<double> ratios;
  bool all_equal = true;
  for (const std::filesystem::path& path : paths) {
    const std::optional<Result> result = MeasureFile(path);
    if (!result) continue;
    ratios.push_back(result->ratio);
    all_equal = all_equal && result->equal;
  }
  if (ratios.empty()) {
    std::printf("no scene below \"%s\" is rendered: nothing to compare\n", folder.c_str());
    return 0;
  }
  std::sort(ratios.begin(), ratios.end());
  const double median = ratios[ratios.size() / 2];
  std::printf("%zu scenes, median ratio %.3f, pictures %s\n", ratios.size(), median,
              all_equal ? "equal" : "DIFFER");
  return all_equal && median >= median_min ? 0 : 1;
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) {
  const char* folder = argc > 1 ? argv[1] : std::getenv("SHEAF_PUBLIC_SCENES");
  return sheaf::render::Run(folder == nullptr ? "" : folder,
                            argc > 2 ? std::strtod(argv[2], nullptr) : 0);
}
