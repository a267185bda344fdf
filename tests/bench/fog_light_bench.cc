// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// fog_light_bench [MIN_GAIN]: what gathering light along lines through thin fog gives over light at
// the ends of flights alone, in the same time: a lamp without size in a room of fog of optical
// thickness 0.2, above most of the rays of the picture. Prints the mean squared error of both
// times their CPU seconds, from the spread of independent replicates, and the ratio. Exits with 1
// where that is below MIN_GAIN.
#include <cstdio>
#include <cstdlib>
#include <vector>

#include "common/film/film_tile.h"
#include "tests/bench/measures.h"
#include "tests/bench/picture_error.h"
#include "tests/support/test_scene.h"
#include "worker/render/render_row.h"
#include "worker/render/variant_list.h"

namespace sheaf::render {
namespace {

constexpr int32_t kSizePx = 64;
constexpr uint64_t kSamples = 256;

TestScene ThinFog() {
  TestScene t({0, 1, -4}, {0, 1, 0}, 40);
  MediumDescription fog;
  fog.sigma_s.rgb = Rgb::Grey(0.02f);
  fog.sigma_a.rgb = Rgb::Grey(0.002f);
  t.scene.media.push_back(fog);
  t.scene.camera.medium = 0;
  t.AddShape(MeshShape{t.Quad({-5, 0, 5}, {-5, 5, 5}, {5, 5, 5}, {5, 0, 5})}, t.Diffuse({}));
  t.AddShape(MeshShape{t.Quad({-5, 0, -5}, {-5, 0, 5}, {5, 0, 5}, {5, 0, -5})}, t.Diffuse({}));
  PointLight lamp;
  lamp.intensity.rgb = Rgb::Grey(10);
  lamp.from = {0.3f, 1.2f, 1};
  t.scene.lights.push_back({lamp, {}, {}, {}});
  return t;
}

template <DirectLight kDirectLight>
double ErrorTimesSeconds(const CompiledScene& scene) {
  const FrameSettings& settings = SettingsOf(scene);
  FilmTile tile(settings.window, {0, settings.samples});
  PixelAccumulator accumulator(&tile);
  RayCounts counts;
  PathTracer<kAllTraits, const EmbreeScene, kDirectLight> tracer(scene, *scene.tracer, counts);
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
  return VarianceOfMeans(tile) * seconds;
}

int Run(double gain_min) {
  FrameSettings settings = SquareSettings(kSizePx, kSamples, 1);
  const CompiledScenePtr scene = Compile(ThinFog().scene, settings);
  std::vector<double> gains;
  for (int round = 0; round < 3; ++round) {
    const double flights = ErrorTimesSeconds<DirectLight::kBySampling>(*scene);
    const double all = ErrorTimesSeconds<DirectLight::kByBoth>(*scene);
    gains.push_back(flights / all);
    std::printf("MSE x CPU s: flights alone %.3g, with lines %.3g, ratio %.1f\n", flights, all,
                gains.back());
  }
  const double gain = MedianOf(gains);
  std::printf("median %.1f\n", gain);
  return gain >= gain_min ? 0 : 1;
}

}  // namespace
}  // namespace sheaf::render

int main(int argc, char** argv) { return sheaf::render::Run(argc > 1 ? std::atof(argv[1]) : 0); }
