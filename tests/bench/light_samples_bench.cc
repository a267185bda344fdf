// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// light_samples_bench [SAMPLES]: gain and cost of several light samples at a vertex
// (docs/adr/0070). In scenes of many small lamps above a floor with blocks it renders the same
// number of samples of a pixel with limits of 1, 2, 4, 8 and 16 light samples, and prints
// - relMSE, from the spread of the replicates, relative to the squares of the pixels' means,
// - the thread's seconds, and rays,
// - their product with relMSE, relative to that of a single light sample: below 1 it pays.
#include <cstdio>
#include <cstdlib>
#include <random>
#include <string>

#include "common/film/film_tile.h"
#include "tests/bench/measures.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

constexpr int32_t kSizePx = 64;

class Random {
 public:
  float Between(float low, float high) {
    return low + (high - low) * static_cast<float>(engine_() >> 40) * 0x1p-24f;
  }

 private:
  std::mt19937_64 engine_{3};
};

// count lamps within [-5, 5] x [height_min, height_max] x [-5, 5].
TestScene Lamps(int count, float height_min, float height_max, bool has_blocks) {
  TestScene t({0, 3.2, -6.5}, {0, 0.2, 0}, 45);
  t.AddShape(MeshShape{t.Quad({-6, 0, -6}, {-6, 0, 6}, {6, 0, 6}, {6, 0, -6})},
             t.Diffuse({0.6f, 0.55f, 0.5f}));
  Random random;
  for (int i = 0; has_blocks && i < 25; ++i) {
    const float x = random.Between(-4.5f, 4.5f), z = random.Between(-4, 4.5f);
    const float half = random.Between(0.15f, 0.5f), height = random.Between(0.3f, 1.1f);
    t.AddShape(MeshShape{t.Box({x - half, 0, z - half}, {x + half, height, z + half})},
               t.Diffuse({0.4f, 0.5f, 0.6f}));
  }
  constexpr float kRadius = 0.02f;
  const int32_t black = t.Diffuse({});
  const int32_t lamps[] = {t.AreaLight({20, 16, 12}), t.AreaLight({12, 16, 20}),
                           t.AreaLight(Rgb::Gray(160))};
  for (int i = 0; i < count; ++i) {
    const double x = static_cast<double>(random.Between(-5, 5)),
                 y = static_cast<double>(random.Between(height_min, height_max)),
                 z = static_cast<double>(random.Between(-5, 5));
    t.AddShape(SphereShape{kRadius, -kRadius, kRadius, 360}, black, TranslateMatrix({x, y, z}))
        .area_light = lamps[i % 3];
  }
  return t;
}

// Mean over pixels of the variance of the red channel's mean over its square.
double RelativeErrorOf(const FilmTile& film) {
  const double count = film.replicate_count();
  double whole = 0, error = 0;
  for (const bool is_error : {false, true}) {
    for (size_t pixel = 0; pixel < film.plane_size(); ++pixel) {
      double sum = 0, squares = 0;
      for (uint32_t r = 0; r < film.replicate_count(); ++r) {
        const double mean = static_cast<double>(film.replicate(r, 0)[pixel]) /
                            static_cast<double>(film.replicate(r, 3)[pixel]);
        sum += mean;
        squares += mean * mean;
      }
      const double mean = sum / count, pixels = static_cast<double>(film.plane_size());
      if (!is_error) {
        whole += mean / pixels;
      } else {
        error += (squares - sum * mean) / (count * (count - 1)) /
                 (mean * mean + 0.01 * whole * whole) / pixels;
      }
    }
  }
  return error;
}

void Run(const std::string& name, const TestScene& scene, uint64_t samples, int32_t depth) {
  std::printf("%s, depth %d, %llu samples\n%8s  %10s  %8s  %12s  %14s  %14s\n", name.c_str(), depth,
              static_cast<unsigned long long>(samples), "limit", "relMSE", "CPU s", "rays",
              "relMSE x CPU", "relMSE x rays");
  double by_time = 0, by_rays = 0;
  for (const int32_t limit : {0, 2, 4, 8, 16}) {
    FrameSettings settings = SquareSettings(kSizePx, samples, depth);
    settings.light_samples = limit;
    const CompiledScenePtr compiled = Compile(scene.scene, settings);
    RenderStats stats;
    const double start = ThreadCpuSeconds();
    const FilmTile film = RenderAll(*compiled, &stats);
    const double seconds = ThreadCpuSeconds() - start, error = RelativeErrorOf(film);
    const auto rays = static_cast<double>(stats.rays);
    if (limit == 0) {
      by_time = seconds * error;
      by_rays = rays * error;
    }
    std::printf("%8d  %10.3e  %8.2f  %12.0f  %14.3f  %14.3f\n", limit == 0 ? 1 : limit, error,
                seconds, rays, seconds * error / by_time, rays * error / by_rays);
    std::fflush(stdout);
  }
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) {
  using sheaf::render::Lamps;
  using sheaf::render::Run;
  const long samples = argc > 1 ? std::atol(argv[1]) : 64;
  if (samples < 16) {
    std::fprintf(stderr, "light_samples_bench [SAMPLES]: at least 16 samples of a pixel\n");
    return 1;
  }
  const auto count = static_cast<uint64_t>(samples);
  Run("1000 lamps near the floor, blocks", Lamps(1000, 0.15f, 1.2f, true), count, 1);
  Run("1000 lamps near the floor, blocks", Lamps(1000, 0.15f, 1.2f, true), count, 3);
  Run("1000 lamps near the floor", Lamps(1000, 0.15f, 1.2f, false), count, 3);
  Run("1000 lamps in the height, blocks", Lamps(1000, 4, 5, true), count, 3);
  Run("8 lamps, blocks", Lamps(8, 1.5f, 2.5f, true), count, 3);
  return 0;
}
