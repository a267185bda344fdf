// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// similarity_bench [SAMPLES [THICKNESS]]: cost and bias of similarity (docs/adr/0031) in its
// intended case: a forward-scattering cube without absorption (g = 0.9) of optical thickness 100,
// or as given, under a bright ceiling, as a homogeneous medium and on a grid. Prints, for several
// numbers of scatterings after which media are reduced, against an unbiased image of another seed:
// - the relative difference of the images' means and its standard error,
// - the relMSE between the converged images, without their noise, and its standard error: over 8
//   independent pairs of replicates, the mean product of the differences in both of a pair,
//   relative to the squares of a third image,
// - the rays, and the thread's seconds, relative to the unbiased image.
//
// The first line compares the unbiased image with itself for two seeds: it must show no bias.
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <utility>
#include <vector>

#include "common/film/film_tile.h"
#include "tests/bench/measures.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

constexpr int32_t kSizePx = 12;
constexpr int32_t kDepth = 1 << 20;

TestScene Milk(float thickness, bool on_grid) {
  TestScene t({2.2, 1.4, -3.6}, {0, -0.1, 0}, 36);
  t.AddShape(MeshShape{t.Quad({-9, 1.5f, -9}, {9, 1.5f, -9}, {9, 1.5f, 9}, {-9, 1.5f, 9})},
             t.Diffuse({}))
      .area_light = t.AreaLight(Rgb::Gray(1));
  MediumDescription milk;
  milk.sigma_s.rgb = Rgb::Gray(thickness / 2);
  milk.g = 0.9f;
  if (on_grid) {
    UniformGridMedium grid;
    grid.box = {{3, 3, 3}, {-3, -3, -3}, {3, 3, 3}};
    grid.density.assign(27, 1.0f);
    milk.kind = std::move(grid);
  }
  t.scene.media.push_back(std::move(milk));
  t.AddShape(MeshShape{t.Box({-1, -1, -1}, {1, 1, 1})}, t.AddMaterial(InterfaceMaterial{}))
      .media.inside = 0;
  return t;
}

struct Image {
  FilmTile film;
  double seconds = 0, rays = 0;
};
Image Make(const SceneDescription& scene, uint64_t samples, int32_t after, uint64_t seed) {
  FrameSettings settings = SquareSettings(kSizePx, samples, kDepth);
  settings.similarity_after = after;
  settings.seed = seed;
  const CompiledScenePtr compiled = Compile(scene, settings);
  RenderStats stats;
  const double start = ThreadCpuSeconds();
  FilmTile film = RenderAll(*compiled, &stats);
  return {std::move(film), ThreadCpuSeconds() - start, static_cast<double>(stats.rays)};
}

struct Estimate {
  double mean = 0, error = 0;
};
Estimate EstimateOf(const std::vector<double>& draws) {
  double sum = 0, squares = 0;
  for (const double draw : draws) sum += draw;
  const auto count = static_cast<double>(draws.size());
  for (const double draw : draws) squares += (draw - sum / count) * (draw - sum / count);
  return {sum / count, std::sqrt(squares / (count * (count - 1)))};
}

double ValueOf(const FilmTile& film, uint32_t replicate, size_t pixel) {
  return static_cast<double>(film.replicate(replicate, 1)[pixel]) /
         static_cast<double>(film.replicate(replicate, 3)[pixel]);
}
// Mean of each pixel over all replicates.
std::vector<double> MeansOf(const FilmTile& film) {
  std::vector<double> means(film.plane_size());
  for (size_t i = 0; i < means.size(); ++i) {
    for (uint32_t r = 0; r < film.replicate_count(); ++r) {
      means[i] += ValueOf(film, r, i) / film.replicate_count();
    }
  }
  return means;
}

struct Bias {
  Estimate of_mean, rel_mse;
};
// reference: the image that differences are relative to, pixel by pixel. Its noise is independent.
Bias BiasOf(const FilmTile& film, const FilmTile& unbiased, const std::vector<double>& reference) {
  double mean = 0;
  for (const double value : reference) mean += value / static_cast<double>(reference.size());
  std::vector<double> of_mean, rel_mse;
  for (uint32_t r = 0; r < film.replicate_count(); r += 2) {
    double sum = 0;
    std::array<double, 2> differences{};
    for (size_t i = 0; i < reference.size(); ++i) {
      const double first = ValueOf(film, r, i) - ValueOf(unbiased, r, i);
      const double second = ValueOf(film, r + 1, i) - ValueOf(unbiased, r + 1, i);
      sum += first * second / (reference[i] * reference[i] + 0.01 * mean * mean);
      differences[0] += first;
      differences[1] += second;
    }
    const auto count = static_cast<double>(reference.size());
    rel_mse.push_back(sum / count);
    for (const double difference : differences) of_mean.push_back(difference / (count * mean));
  }
  return {EstimateOf(of_mean), EstimateOf(rel_mse)};
}

void Run(uint64_t samples, float thickness) {
  for (const bool on_grid : {false, true}) {
    const SceneDescription scene = Milk(thickness, on_grid).scene;
    std::printf("%s, optical thickness %g, g 0.9, albedo 1, %d x %d pixels, %llu samples\n",
                on_grid ? "grid" : "homogeneous", static_cast<double>(thickness), kSizePx, kSizePx,
                static_cast<unsigned long long>(samples));
    std::printf("%8s  %22s  %24s  %10s  %10s\n", "after", "mean, relative", "relMSE of the bias",
                "rays", "time");
    const Image unbiased = Make(scene, samples, 0, 1);
    const std::vector<double> reference = MeansOf(Make(scene, 4 * samples, 8, 3).film);
    for (const int32_t after : {0, 1, 2, 4, 8, 16, 32, 64}) {
      const Image image = Make(scene, samples, after, 2);
      const Bias bias = BiasOf(image.film, unbiased.film, reference);
      std::printf("%8d  %+10.5f +- %8.5f  %11.3e +- %9.1e  %10.3f  %10.3f\n", after,
                  bias.of_mean.mean, bias.of_mean.error, bias.rel_mse.mean, bias.rel_mse.error,
                  image.rays / unbiased.rays, image.seconds / unbiased.seconds);
      std::fflush(stdout);
    }
  }
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) {
  const long samples = argc > 1 ? std::atol(argv[1]) : 512;
  const double thickness = argc > 2 ? std::atof(argv[2]) : 100;
  if (samples < 16 || (samples & (samples - 1)) != 0 || !(thickness > 0)) {
    std::fprintf(stderr,
                 "similarity_bench [SAMPLES [THICKNESS]]: a power of two of samples, 16 or more, "
                 "and a thickness above 0\n");
    return 1;
  }
  sheaf::render::Run(static_cast<uint64_t>(samples), static_cast<float>(thickness));
  return 0;
}
