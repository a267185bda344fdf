// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// variant_speed_bench FOLDER [MIN_MEDIAN]: the gain of compiled variants. Every scene below the
// folder that Sheaf reads is rendered by the variant that its plan chooses and by the generic one,
// in turns on one thread; the images must be equal to the bit. Prints the ratio of their CPU times
// (generic over chosen) for each scene, and the median. Exits with 1 if images differ or the median
// is below MIN_MEDIAN. If FOLDER is missing, empty or does not exist, it says so and does nothing.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tests/bench/bench_scene.h"
#include "worker/render/integrator/variants.h"
#include "worker/render/scene/compiled_scene.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {
namespace {

constexpr int kRounds = 9;
constexpr int32_t kTileSizePx = 16;
constexpr size_t kTilesMax = 48;  // Spread evenly over the frame.
constexpr uint64_t kSamples = 4;

FilmTile Render(const CompiledScene& scene, const PixelRect& rect, size_t variant) {
  FilmTile tile(rect, {0, kSamples});
  PixelAccumulator accumulator(&tile);
  RayCounts counts;
  for (int32_t y = rect.y0; y < rect.y1; ++y) {
    RowFunctionOf(variant)(scene, rect.x0, rect.x1, y, {0, kSamples}, &accumulator, &counts);
  }
  return tile;
}

struct Result {
  double ratio = 1;
  bool equal = true;
};

Result Measure(const CompiledScene& scene) {
  const size_t chosen = ChooseVariant(scene.plan.traits, false);
  const size_t generic = ChooseVariant(scene.plan.traits, true);
  const std::vector<PixelRect> tiles = SomeTiles(scene.settings.window, kTileSizePx, kTilesMax);
  std::vector<double> ratios;
  Result result;
  for (int round = 0; round <= kRounds; ++round) {
    double seconds[2] = {0, 0};
    // Alternates per tile, so that disturbances of the machine affect both; the order alternates
    // too.
    for (size_t i = 0; i < tiles.size(); ++i) {
      const bool generic_first = (i + static_cast<size_t>(round)) % 2 == 0;
      const double start = ThreadCpuSeconds();
      const FilmTile first = Render(scene, tiles[i], generic_first ? generic : chosen);
      const double middle = ThreadCpuSeconds();
      const FilmTile second = Render(scene, tiles[i], generic_first ? chosen : generic);
      const double end = ThreadCpuSeconds();
      seconds[generic_first ? 0 : 1] += middle - start;
      seconds[generic_first ? 1 : 0] += end - middle;
      result.equal = result.equal && first == second;
    }
    if (round > 0) ratios.push_back(seconds[0] / seconds[1]);  // The first round warms caches.
  }
  result.ratio = MedianOf(ratios);
  return result;
}

// nullopt if Sheaf does not render the file.
std::optional<Result> MeasureFile(const std::filesystem::path& path) {
  ReadFile file(path);
  absl::Status status = ReadSceneFile(path, 0, &file);
  if (status.ok()) {
    const auto scene = CompileScene(std::move(file.scene), file.settings, file.files);
    if (scene.ok()) {
      const Result result = Measure(**scene);
      std::printf("%-36s %-34s ratio %.3f%s\n", path.filename().c_str(),
                  (*scene)->plan.variant_name.c_str(), result.ratio,
                  result.equal ? "" : ", IMAGES DIFFER");
      std::fflush(stdout);
      return result;
    }
    status = scene.status();
  }
  PrintNotRendered(path, status);
  return std::nullopt;
}

int Run(const std::string& folder, double median_min) {
  std::error_code error;
  if (folder.empty() || !std::filesystem::is_directory(folder, error)) {
    std::printf("no folder of scenes \"%s\": nothing to compare\n", folder.c_str());
    return 0;
  }
  std::vector<double> ratios;
  bool all_equal = true;
  for (const std::filesystem::path& path : SceneFilesAt(folder)) {
    const std::optional<Result> result = MeasureFile(path);
    if (!result) continue;
    ratios.push_back(result->ratio);
    all_equal = all_equal && result->equal;
  }
  if (ratios.empty()) {
    std::printf("no scene below \"%s\" is rendered: nothing to compare\n", folder.c_str());
    return 0;
  }
  const double median = MedianOf(ratios);
  std::printf("%zu scenes, median ratio %.3f, images %s\n", ratios.size(), median,
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
