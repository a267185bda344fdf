// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ray_rate_bench SCENE [SAMPLES] [MIN_RATIO]: how much of bare Embree's speed the path tracer
// keeps. It records every ray that a render of the scene traces, then, in turns within one run and
// on one thread, renders the scene and replays the very same rays through Embree alone (same device
// settings, same tree, no filter functions). The ratio is that of rays per second, by the CPU time
// of the thread. Exits with 1 where the median of the rounds' ratios is below MIN_RATIO.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string>
#include <vector>

#include "common/film/tile_geometry.h"
#include "common/scene/render_settings.h"
#include "common/scene/scene_reader.h"
#include "worker/render/compiled_scene.h"
#include "worker/render/render_row.h"
#include "worker/render/tile_pass.h"

namespace sheaf::render {
namespace {

constexpr int kRounds = 7;
constexpr int32_t kTileSizePx = 32;
constexpr uint64_t kRecordedRaysMax = uint64_t{24} << 20;  // Bounds the memory of the recording.

// Traces and remembers.
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

 private:
  const EmbreeScene& tracer_;
  std::vector<RecordedRay>* rays_;
};

double CpuSeconds() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

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

// In the order of RenderOnce. The generic variant traces the same rays as any other.
std::vector<RecordedRay> Record(const CompiledScene& scene, const Work& work) {
  std::vector<RecordedRay> rays;
  RecordingTracer recorder(*scene.tracer, &rays);
  RayCounts counts;
  PathTracer<kAllTraits, RecordingTracer> tracer(scene, recorder, counts);
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

int Run(const std::string& path, uint64_t samples, double ratio_min) {
  const size_t slash = path.rfind('/');
  DirectoryFileSource files(slash == std::string::npos ? "." : path.substr(0, slash));
  auto read = ReadScene(slash == std::string::npos ? path : path.substr(slash + 1), files);
  if (!read.ok()) {
    std::fprintf(stderr, "%s\n", read.status().ToString().c_str());
    return 2;
  }
  RenderSettings wished;
  wished.samples = samples;
  const auto settings = ResolveSettings(read->scene, wished);
  if (!settings.ok()) {
    std::fprintf(stderr, "%s\n", settings.status().ToString().c_str());
    return 2;
  }
  auto compiled = CompileScene(std::move(read->scene), *settings, files);
  if (!compiled.ok()) {
    std::fprintf(stderr, "%s\n", compiled.status().ToString().c_str());
    return 2;
  }
  const CompiledScene& scene = **compiled;
  const Work work{CutTiles(settings->window, kTileSizePx), {0, samples}};
  auto bare = EmbreeScene::Build(scene.geometry, 0, EmbreeScene::Filters::kNone);
  if (!bare.ok()) return 2;
  const std::vector<RecordedRay> rays = Record(scene, work);
  std::vector<double> ratios;
  for (int round = 0; round <= kRounds; ++round) {
    const double start = CpuSeconds();
    const uint64_t rendered = RenderOnce(scene, work);
    const double middle = CpuSeconds();
    const uint64_t met = (*bare)->Replay(rays);
    const double end = CpuSeconds();
    if (round == 0) continue;  // Warms caches and textures.
    const double traced_rate = static_cast<double>(rendered) / (middle - start);
    const double bare_rate = static_cast<double>(rays.size()) / (end - middle);
    ratios.push_back(traced_rate / bare_rate);
    std::printf(
        "path tracer %.3f Mrays/s, bare Embree %.3f Mrays/s (%zu of %llu rays, %llu met), ratio "
        "%.3f\n",
        traced_rate * 1e-6, bare_rate * 1e-6, rays.size(),
        static_cast<unsigned long long>(rendered), static_cast<unsigned long long>(met),
        ratios.back());
  }
  std::sort(ratios.begin(), ratios.end());
  const double median = ratios[ratios.size() / 2];
  std::printf("%s: variant %s, median ratio %.3f\n", path.c_str(), scene.plan.variant_name.c_str(),
              median);
  return median >= ratio_min ? 0 : 1;
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: %s SCENE.pbrt [SAMPLES, a power of two] [MIN_RATIO]\n", argv[0]);
    return 2;
  }
  const uint64_t samples = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 8;
  const double ratio_min = argc > 3 ? std::strtod(argv[3], nullptr) : 0;
  if (samples == 0 || (samples & (samples - 1)) != 0) {
    std::fprintf(stderr, "%s: SAMPLES must be a power of two\n", argv[0]);
    return 2;
  }
  return sheaf::render::Run(argv[1], samples, ratio_min);
}
