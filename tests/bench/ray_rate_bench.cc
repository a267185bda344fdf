// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ray_rate_bench PATH [SAMPLES] [MIN_RATIO] [MIN_MEDIAN]: the path tracer's ray rate as a fraction
// of Embree's own, for the scene file PATH or each one below the folder PATH. It records every ray
// that a render of the scene traces, then, in turns within one run and on one thread, renders the
// scene and replays the same rays through Embree only (same device settings, same tree, no filter
// functions). The ratio is that of rays per CPU second of the thread. Exits with 1 if the median of
// a scene's rounds is below MIN_RATIO, or the median over scenes below MIN_MEDIAN.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "tests/bench/bench_scene.h"
#include "worker/render/integrator/render_row.h"
#include "worker/render/scene/compiled_scene.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {
namespace {

constexpr int kRounds = 7;
constexpr int32_t kTileSizePx = 32;
constexpr size_t kTilesMax = 64;                           // Spread evenly over the frame.
constexpr uint64_t kRecordedRaysMax = uint64_t{24} << 20;  // Limits the memory of the recording.

// Traces rays and records them.
class RecordingTracer {
 public:
  RecordingTracer(const EmbreeScene& tracer, std::vector<RecordedRay>* rays)
      : tracer_(tracer), rays_(rays) {}
  bool Intersect(const Ray& ray, RawHit* hit) {
    rays_->push_back({ray, false});
    return tracer_.Intersect(ray, hit);
  }
  bool Occluded(const Ray& ray) {
    rays_->push_back({ray, true});
    return tracer_.Occluded(ray);
  }
  Passage PassageOf(const Ray& ray) {
    rays_->push_back({ray, true});
    return tracer_.PassageOf(ray);
  }

 private:
  const EmbreeScene& tracer_;
  std::vector<RecordedRay>* rays_;
};

struct Work {
  std::vector<PixelRect> tiles;
  SampleBlock block;
};

uint64_t RenderOnce(const CompiledScene& scene, const Work& work) {
  uint64_t rays = 0;
  for (const PixelRect& tile : work.tiles) {
    RenderStats stats;
    if (!RenderTilePass(scene, tile, work.block, {}, &stats).ok()) return 0;
    rays += stats.rays;
  }
  return rays;
}

// Records rays in the order of RenderOnce. The generic variant traces the same rays as any other.
std::vector<RecordedRay> Record(const CompiledScene& scene, const Work& work) {
  std::vector<RecordedRay> rays;
  RecordingTracer recorder(*scene.tracer, &rays);
  RayCounts counts;
  PathIntegrator<kAllTraits, RecordingTracer> tracer(scene, recorder, counts);
  for (const PixelRect& tile : work.tiles) {
    for (int32_t y = tile.y0; y < tile.y1; ++y) {
      for (int32_t x = tile.x0; x < tile.x1; ++x) {
        for (uint64_t s = work.block.first; s < work.block.End(); ++s) tracer.TraceSample(x, y, s);
      }
    }
    if (rays.size() > kRecordedRaysMax) break;
  }
  return rays;
}

// Prints and returns the median of the rounds' ratios; nullopt if Sheaf does not render the file.
std::optional<double> MeasureFile(const std::filesystem::path& path, uint64_t samples) {
  ReadFile file(path);
  if (const auto status = ReadSceneFile(path, samples, &file); !status.ok()) {
    PrintNotRendered(path, status);
    return std::nullopt;
  }
  const auto compiled = CompileScene(std::move(file.scene), file.settings, file.files);
  if (!compiled.ok()) {
    PrintNotRendered(path, compiled.status());
    return std::nullopt;
  }
  const CompiledScene& scene = **compiled;
  const Work work{SomeTiles(scene.settings.window, kTileSizePx, kTilesMax), {0, samples}};
  const auto bare = EmbreeScene::Build(scene.geometry, 0, EmbreeScene::Filters::kNone);
  if (!bare.ok()) {
    PrintNotRendered(path, bare.status());
    return std::nullopt;
  }
  const std::vector<RecordedRay> rays = Record(scene, work);
  std::vector<double> ratios, traced_rates, bare_rates;
  uint64_t rendered = 0;
  for (int round = 0; round <= kRounds; ++round) {
    const double start = ThreadCpuSeconds();
    rendered = RenderOnce(scene, work);
    const double middle = ThreadCpuSeconds();
    (*bare)->Replay(rays);
    const double end = ThreadCpuSeconds();
    if (round == 0) continue;  // The first round warms caches and textures.
    traced_rates.push_back(static_cast<double>(rendered) / (middle - start));
    bare_rates.push_back(static_cast<double>(rays.size()) / (end - middle));
    ratios.push_back(traced_rates.back() / bare_rates.back());
  }
  const double median = MedianOf(ratios);
  const auto [low, high] = std::minmax_element(ratios.begin(), ratios.end());
  std::printf("%-36s %-24s %6.3f of %6.3f Mrays/s (%zu of %llu rays), ratio %.3f (%.3f to %.3f)\n",
              path.filename().c_str(), scene.plan.variant_name.c_str(),
              MedianOf(traced_rates) * 1e-6, MedianOf(bare_rates) * 1e-6, rays.size(),
              static_cast<unsigned long long>(rendered), median, *low, *high);
  std::fflush(stdout);
  return median;
}

int Run(const std::string& path, uint64_t samples, double ratio_min, double median_min) {
  std::vector<double> ratios;
  for (const std::filesystem::path& file : SceneFilesAt(path)) {
    if (const auto ratio = MeasureFile(file, samples)) ratios.push_back(*ratio);
  }
  if (ratios.empty()) {
    std::fprintf(stderr, "%s: no scene there is rendered\n", path.c_str());
    return 2;
  }
  const double median = MedianOf(ratios), least = *std::min_element(ratios.begin(), ratios.end());
  std::printf("%zu scenes: median ratio %.3f, least %.3f\n", ratios.size(), median, least);
  return least >= ratio_min && median >= median_min ? 0 : 1;
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: %s PATH [SAMPLES, a power of two] [MIN_RATIO] [MIN_MEDIAN]\n",
                 argv[0]);
    return 2;
  }
  const uint64_t samples = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 8;
  if (samples == 0 || (samples & (samples - 1)) != 0) {
    std::fprintf(stderr, "%s: SAMPLES must be a power of two\n", argv[0]);
    return 2;
  }
  return sheaf::render::Run(argv[1], samples, argc > 3 ? std::strtod(argv[3], nullptr) : 0,
                            argc > 4 ? std::strtod(argv[4], nullptr) : 0);
}
