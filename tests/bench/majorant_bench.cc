// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// majorant_bench SCENE [MIN_GAIN] [WIDTH_PX] [SAMPLES]: the gain of local majorants of a medium's
// density over one global majorant, at equal time. Renders the scene with both, in turns, and
// prints the mean squared error of each times its CPU seconds, from the spread of independent
// replicates, and the ratio. Exits with 1 if the median is below MIN_GAIN.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <utility>
#include <vector>

#include "common/base/check.h"
#include "tests/bench/bench_scene.h"
#include "tests/bench/image_error.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {
namespace {

constexpr int kRounds = 3;

// Compiles the file's scene with the requested majorants. Returns null and prints the reason if the
// scene is not rendered.
CompiledScenePtr CompileFile(ReadFile* file, const std::filesystem::path& path, int32_t width_px,
                             uint64_t samples, bool bound_once) {
  absl::Status status = ReadSceneFile(path, samples, file);
  if (status.ok()) {
    FrameSettings& settings = file->settings;
    settings.height_px = std::max(1, settings.height_px * width_px / settings.width_px);
    settings.width_px = width_px;
    settings.window = {0, 0, settings.width_px, settings.height_px};
    auto scene = CompileScene(std::move(file->scene), settings, file->files, {},
                              {.bound_media_once = bound_once});
    if (scene.ok()) return *std::move(scene);
    status = scene.status();
  }
  PrintNotRendered(path, status);
  return nullptr;
}

double ErrorTimesSeconds(const CompiledScene& scene) {
  const FrameSettings& settings = SettingsOf(scene);
  const double start = ThreadCpuSeconds();
  const auto tile = RenderTilePass(scene, settings.window, {0, settings.samples}, {}, nullptr);
  const double seconds = ThreadCpuSeconds() - start;
  SHEAF_CHECK(tile.ok());
  return VarianceOfMeans(*tile) * seconds;
}

int Run(const std::filesystem::path& path, double gain_min, int32_t width_px, uint64_t samples) {
  ReadFile local_file(path), global_file(path);
  const CompiledScenePtr local = CompileFile(&local_file, path, width_px, samples, false);
  const CompiledScenePtr global = CompileFile(&global_file, path, width_px, samples, true);
  if (local == nullptr || global == nullptr) return 2;
  std::vector<double> gains;
  for (int round = 0; round < kRounds; ++round) {
    const double one = ErrorTimesSeconds(*global), many = ErrorTimesSeconds(*local);
    gains.push_back(one / many);
    std::printf("MSE x CPU s: one bound %.3g, local ones %.3g, ratio %.2f\n", one, many,
                gains.back());
  }
  const double gain = MedianOf(gains);
  std::printf("median %.2f\n", gain);
  return gain >= gain_min ? 0 : 1;
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: %s SCENE [MIN_GAIN] [WIDTH_PX] [SAMPLES]\n", argv[0]);
    return 2;
  }
  return sheaf::render::Run(argv[1], argc > 2 ? std::atof(argv[2]) : 0,
                            argc > 3 ? std::atoi(argv[3]) : 128,
                            argc > 4 ? std::strtoull(argv[4], nullptr, 10) : 64);
}
