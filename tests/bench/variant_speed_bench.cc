// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// variant_speed_bench [--images-only] [FOLDER [MIN_MEDIAN]]: the gain of compiled variants. Every
// scene below the folder that Sheaf reads is rendered by the variant that its plan chooses and by
// the generic one, in turns on one thread; the images must be equal to the bit. Prints the ratio of
// their CPU times (generic over chosen) for each scene, and the median. Exits with 1 if images
// differ or the median is below MIN_MEDIAN. --images-only renders each tile once by each variant
// and prints no ratios: further rounds render the same samples, for their time alone. Without
// FOLDER it takes SHEAF_PUBLIC_SCENES; if that is missing, empty or no folder, it says so and does
// nothing.
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
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

// One round over all tiles.
struct Round {
  double chosen_seconds = 0, generic_seconds = 0;
  bool equal = true;
};

// Alternates per tile, so that disturbances of the machine affect both; the order alternates too.
Round RenderRound(const CompiledScene& scene, const std::vector<PixelRect>& tiles, int round) {
  const size_t chosen = ChooseVariant(scene.plan.traits, false);
  const size_t generic = ChooseVariant(scene.plan.traits, true);
  Round result;
  for (size_t i = 0; i < tiles.size(); ++i) {
    const bool generic_first = (i + static_cast<size_t>(round)) % 2 == 0;
    const double start = ThreadCpuSeconds();
    const FilmTile first = Render(scene, tiles[i], generic_first ? generic : chosen);
    const double middle = ThreadCpuSeconds();
    const FilmTile second = Render(scene, tiles[i], generic_first ? chosen : generic);
    const double end = ThreadCpuSeconds();
    result.generic_seconds += generic_first ? middle - start : end - middle;
    result.chosen_seconds += generic_first ? end - middle : middle - start;
    result.equal = result.equal && first == second;
  }
  return result;
}

struct Result {
  double ratio = 1;  // 1 if no round was timed.
  bool equal = true;
};

Result Measure(const CompiledScene& scene, int timed_rounds) {
  const std::vector<PixelRect> tiles = SomeTiles(scene.settings.window, kTileSizePx, kTilesMax);
  std::vector<double> ratios;
  Result result;
  for (int i = 0; i <= timed_rounds; ++i) {
    const Round round = RenderRound(scene, tiles, i);
    result.equal = result.equal && round.equal;
    // The first round warms caches.
    if (i > 0) ratios.push_back(round.generic_seconds / round.chosen_seconds);
  }
  if (!ratios.empty()) result.ratio = MedianOf(ratios);
  return result;
}

void Print(const std::string& name, const std::string& variant, const Result& result,
           bool is_timed) {
  std::printf("%-36s %-34s ", name.c_str(), variant.c_str());
  if (is_timed) std::printf("ratio %.3f, ", result.ratio);
  std::printf("images %s\n", result.equal ? "equal" : "DIFFER");
  std::fflush(stdout);
}

// nullopt if Sheaf does not render the file.
std::optional<Result> MeasureFile(const std::filesystem::path& path, int timed_rounds) {
  ReadFile file(path);
  absl::Status status = ReadSceneFile(path, 0, &file);
  if (status.ok()) {
    const auto scene = CompileScene(std::move(file.scene), file.settings, file.files);
    if (scene.ok()) {
      const Result result = Measure(**scene, timed_rounds);
      Print(path.filename(), (*scene)->plan.variant_name, result, timed_rounds > 0);
      return result;
    }
    status = scene.status();
  }
  PrintNotRendered(path, status);
  return std::nullopt;
}

int Run(const std::string& folder, int timed_rounds, double median_min) {
  std::error_code error;
  if (folder.empty() || !std::filesystem::is_directory(folder, error)) {
    std::printf("no folder of scenes \"%s\": nothing to compare\n", folder.c_str());
    return 0;
  }
  std::vector<double> ratios;
  bool all_equal = true;
  for (const std::filesystem::path& path : SceneFilesAt(folder)) {
    const std::optional<Result> result = MeasureFile(path, timed_rounds);
    if (!result) continue;
    ratios.push_back(result->ratio);
    all_equal = all_equal && result->equal;
  }
  if (ratios.empty()) {
    std::printf("no scene below \"%s\" is rendered: nothing to compare\n", folder.c_str());
    return 0;
  }
  const double median = MedianOf(ratios);
  std::printf("%zu scenes, ", ratios.size());
  if (timed_rounds > 0) std::printf("median ratio %.3f, ", median);
  std::printf("images %s\n", all_equal ? "equal" : "DIFFER");
  return all_equal && median >= median_min ? 0 : 1;
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) {
  using sheaf::render::kRounds;
  const bool images_only = argc > 1 && std::string_view(argv[1]) == "--images-only";
  const int first = images_only ? 2 : 1;
  const char* folder = argc > first ? argv[first] : std::getenv("SHEAF_PUBLIC_SCENES");
  return sheaf::render::Run(folder == nullptr ? "" : folder, images_only ? 0 : kRounds,
                            argc > first + 1 ? std::strtod(argv[first + 1], nullptr) : 0);
}
