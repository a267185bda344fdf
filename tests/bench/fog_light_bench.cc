// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// fog_light_bench [MIN_GAIN]: the gain of equiangular line sampling in fog over light samples at
// scattering points only, at equal time. Scenes: a point light in a room of fog of optical
// thickness 0.2, above most of the camera rays; the same in heterogeneous fog on a grid; and clouds
// on a grid from thin to dense, with a light inside, beside and far from them. Prints the mean
// squared error times the CPU seconds of both, from the spread of independent replicates, and the
// ratio. Exits with 1 if the ratio is below MIN_GAIN in either room.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <utility>
#include <vector>

#include "common/base/check.h"
#include "common/film/film_tile.h"
#include "tests/bench/image_error.h"
#include "tests/bench/measures.h"
#include "tests/support/test_scene.h"
#include "worker/render/integrator/render_row.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

constexpr int32_t kSizePx = 64;
constexpr uint64_t kSamples = 256;

// A lumpy density grid of mean 1 or, for a cloud, with zero density at the box's surface.
UniformGridMedium Lumps(Vec3d lower, Vec3d upper, bool is_cloud) {
  constexpr int kSide = 48;
  UniformGridMedium grid;
  grid.box = {{kSide, kSide, kSide}, lower, upper};
  double sum = 0;
  for (int i = 0; i < kSide * kSide * kSide; ++i) {
    const double step = 9.0 / kSide;
    const double x = step * (i % kSide), y = step * (i / kSide % kSide),
                 z = step * (i / kSide / kSide);
    const double lump = std::sin(x) * std::sin(y + 1) * std::sin(z + 2) +
                        0.3 * std::sin(2.7 * x + 1) * std::sin(3.1 * y) * std::sin(2.3 * z);
    const double from_middle = std::hypot(x - 4.5, y - 4.5, z - 4.5) / 4.5;
    const double fraction = is_cloud ? std::max(0.0, 1 - from_middle * from_middle) : 1;
    grid.density.push_back(static_cast<float>(std::max(0.0, 0.35 + lump) * fraction));
    sum += static_cast<double>(grid.density.back());
  }
  const auto scale = static_cast<float>(kSide * kSide * kSide / sum);
  if (!is_cloud) {
    for (float& density : grid.density) density *= scale;
  }
  return grid;
}

TestScene ThinFog(bool is_grid) {
  TestScene t({0, 1, -4}, {0, 1, 0}, 40);
  MediumDescription fog;
  fog.sigma_s.rgb = Rgb::Gray(0.02f);
  fog.sigma_a.rgb = Rgb::Gray(0.002f);
  if (is_grid) fog.kind = Lumps({-6, -1, -5}, {6, 6, 6}, false);
  t.scene.media.push_back(std::move(fog));
  t.scene.camera.medium = 0;
  t.AddShape(MeshShape{t.Quad({-5, 0, 5}, {-5, 5, 5}, {5, 5, 5}, {5, 0, 5})}, t.Diffuse({}));
  t.AddShape(MeshShape{t.Quad({-5, 0, -5}, {-5, 0, 5}, {5, 0, 5}, {5, 0, -5})}, t.Diffuse({}));
  PointLight light;
  light.intensity.rgb = Rgb::Gray(10);
  light.from = {0.3f, 1.2f, 1};
  t.scene.lights.push_back({light, {}, {}, {}});
  return t;
}

// A cloud of width 2 on a black background. Lights must be above the visible region: errors of
// pixels whose rays pass close to a light are too far from normally distributed to be compared.
// thickness: the approximate optical thickness across the densest parts.
TestScene Cloud(float thickness, Vec3d light_at) {
  TestScene t({0, 0.6, -4}, {0, 0, 0}, 20);
  MediumDescription cloud;
  cloud.sigma_s.rgb = Rgb::Gray(0.5f * thickness);
  cloud.sigma_a.rgb = Rgb::Gray(0.01f * thickness);
  cloud.g = 0.3f;
  cloud.kind = Lumps({-1, -1, -1}, {1, 1, 1}, true);
  t.scene.media.push_back(std::move(cloud));
  t.AddShape(MeshShape{t.Box({-1, -1, -1}, {1, 1, 1})}, t.AddMaterial(InterfaceMaterial{}))
      .media.inside = 0;
  PointLight light;
  light.intensity.rgb = Rgb::Gray(10);
  light.from = light_at;
  t.scene.lights.push_back({light, {}, {}, {}});
  return t;
}

CompiledScenePtr CompileWith(const TestScene& t, uint64_t samples, int32_t depth,
                             EquiangularMode lines) {
  TableFileSource files({});
  auto scene = CompileScene(t.scene, SquareSettings(kSizePx, samples, depth), files, {},
                            {.equiangular_mode = lines});
  SHEAF_CHECK(scene.ok());
  return *std::move(scene);
}

struct Cost {
  double error = 0, seconds = 0;
  double Product() const { return error * seconds; }
};
template <TraitBits kTraits, DirectLight kDirectLight = DirectLight::kByBoth>
Cost Measure(const CompiledScene& scene) {
  const FrameSettings& settings = SettingsOf(scene);
  FilmTile tile(settings.window, {0, settings.samples});
  PixelAccumulator accumulator(&tile);
  RayCounts counts;
  PathIntegrator<kTraits, const EmbreeScene, kDirectLight> tracer(scene, *scene.tracer, counts);
  const double start = ThreadCpuSeconds();
  for (int32_t y = 0; y < kSizePx; ++y) {
    for (int32_t x = 0; x < kSizePx; ++x) {
      accumulator.Begin(x, y);
      for (uint64_t s = 0; s < settings.samples; ++s) {
        accumulator.Add(s, tracer.TraceSample(x, y, s));
      }
      accumulator.End();
    }
  }
  const double seconds = ThreadCpuSeconds() - start;
  return {VarianceOfMeans(tile), seconds};
}

// The median gain of three rounds.
template <typename DistanceOnly, typename All>
double GainOf(const char* name, const DistanceOnly& render_distance_only, const All& all) {
  std::vector<double> gains, times;
  for (int round = 0; round < 3; ++round) {
    const Cost distance_only = render_distance_only(), with_equiangular = all();
    gains.push_back(distance_only.Product() / with_equiangular.Product());
    times.push_back(with_equiangular.seconds / distance_only.seconds);
    std::printf("%s: MSE x CPU s: flights alone %.3g, with lines %.3g, ratio %.2f\n", name,
                distance_only.Product(), with_equiangular.Product(), gains.back());
  }
  std::printf("%s: median %.2f, in %.2f times the time\n", name, MedianOf(gains), MedianOf(times));
  return MedianOf(gains);
}

int Run(double gain_min) {
  const auto fog = CompileWith(ThinFog(false), kSamples, 1, EquiangularMode::kWhereEfficient);
  double gain = GainOf(
      "fog", [&] { return Measure<kAllTraits, DirectLight::kBySampling>(*fog); },
      [&] { return Measure<kAllTraits>(*fog); });
  const auto measure_grid = [](const char* name, const TestScene& t, uint64_t samples,
                               int32_t depth) {
    const auto without = CompileWith(t, samples, depth, EquiangularMode::kNever);
    const auto with = CompileWith(t, samples, depth, EquiangularMode::kWhereEfficient);
    return GainOf(
        name, [&] { return Measure<kCloudTraits>(*without); },
        [&] { return Measure<kCloudTraits>(*with); });
  };
  gain = std::min(gain, measure_grid("fog on a grid", ThinFog(true), kSamples, 1));
  const std::pair<const char*, Vec3d> positions[] = {
      {"within", {0.2, 0.8, 0.1}}, {"beside", {0.4, 1.15, -0.2}}, {"far", {10, 20, -10}}};
  for (const auto& [where, at] : positions) {
    for (const float thickness : {0.1f, 1.0f, 4.0f, 20.0f, 100.0f}) {
      char name[64];
      std::snprintf(name, sizeof(name), "cloud of thickness %g, lamp %s",
                    static_cast<double>(thickness), where);
      measure_grid(name, Cloud(thickness, at), kSamples / 4, 20);
    }
  }
  return gain >= gain_min ? 0 : 1;
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) { return sheaf::render::Run(argc > 1 ? std::atof(argv[1]) : 0); }
