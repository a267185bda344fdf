// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests whether 95 % confidence intervals of pixels contain the true value where light paths are
// merged: standard errors are widened by the bias layer, as images are developed. Camera paths know
// the truth, without bias. SHEAF_LONG_TESTS=1 renders 200 images of each scene.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <ostream>
#include <string>
#include <utility>
#include <vector>

#include "common/film/film.h"
#include "common/film/light/light_image.h"
#include "common/film/task_kind.h"
#include "tests/support/light_film_sums.h"
#include "tests/support/long_tests.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

constexpr int32_t kEdgePx = 16;
constexpr uint64_t kSamples = 64;
// The quantile for 95 % and the mean of kReplicateCount = 16 replicates.
constexpr double kStudentT15 = 2.131;
constexpr double kCoverageMin = 0.93;

struct MergeCase {
  std::string name;
  std::function<TestScene()> make;
};
void PrintTo(const MergeCase& c, std::ostream* out) { *out << c.name; }

int32_t Mirror(TestScene* t) {
  ConductorMaterial mirror;
  mirror.has_reflectance = true;
  mirror.reflectance.value.rgb = Rgb::Gray(1);
  return t->AddMaterial(mirror);
}

// The spot of a lamp without size, seen in a mirror: a peak that is as narrow as the radius.
TestScene SpotInMirror() {
  TestScene t({-1, 1.5, -2}, {1, 0, 0.5}, 25);
  t.AddShape(MeshShape{t.Box({-3, -0.1f, -2}, {-0.1f, 0, 3})}, t.Diffuse(Rgb::Gray(0.7f)));
  t.AddShape(MeshShape{t.Quad({0, -1, -4}, {0, -1, 4}, {0, 4, 4}, {0, 4, -4})}, Mirror(&t));
  SpotLight lamp;
  lamp.intensity.rgb = Rgb::Gray(1);
  lamp.from = {-1, 0.4, 0.5};
  lamp.to = {-1, 0, 0.5};
  lamp.cone_angle_degrees = 60;
  lamp.cone_delta_angle_degrees = 30;
  t.scene.lights.push_back({lamp, {}, {}, {}});
  return t;
}

// A box and its soft shadow, seen in a mirror.
TestScene ShadowInMirror() {
  TestScene t({-1, 1.5, -2}, {1, 0, 0.5}, 25);
  t.AddShape(MeshShape{t.Box({-3, -0.1f, -2}, {-0.1f, 0, 3})}, t.Diffuse(Rgb::Gray(0.7f)));
  t.AddShape(MeshShape{t.Quad({0, -1, -4}, {0, -1, 4}, {0, 4, 4}, {0, 4, -4})}, Mirror(&t));
  t.AddShape(MeshShape{t.Box({-1.2f, 0, 0.3f}, {-0.9f, 0.3f, 0.6f})}, t.Diffuse(Rgb::Gray(0.5f)));
  t.AddShape(MeshShape{t.Quad({-2.2f, 1.5f, 0.3f}, {-1.6f, 1.5f, 0.3f}, {-1.6f, 1.5f, 0.9f},
                              {-2.2f, 1.5f, 0.9f})},
             t.Diffuse({}))
      .area_light = t.AreaLight(Rgb::Gray(5), true);
  return t;
}

// A floor under a pane and a large lamp.
TestScene FloorUnderGlass() {
  TestScene t({0, 2, -2}, {0, 0, 0}, 30);
  t.AddShape(MeshShape{t.Quad({-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2})},
             t.Diffuse(Rgb::Gray(0.6f)));
  t.AddShape(MeshShape{t.Box({-2, 0.3f, -2}, {2, 0.4f, 2})}, t.AddMaterial(DielectricMaterial{}));
  t.AddShape(MeshShape{t.Quad({-1, 2.5f, -1}, {1, 2.5f, -1}, {1, 2.5f, 1}, {-1, 2.5f, 1})},
             t.Diffuse({}))
      .area_light = t.AreaLight(Rgb::Gray(3), true);
  return t;
}

FrameImage FilmImage(const FilmTile& film) {
  FrameImage image = MakeFrameImage(film.rect(), kEdgePx, kEdgePx, film.outputs());
  DevelopTile(film, &image);
  return image;
}
// The image of both kinds of path, as a farm writes it.
FrameImage ImageOf(const TestScene& t, TechniqueSet techniques, uint64_t seed, uint64_t samples) {
  FrameSettings settings = SquareSettings(kEdgePx, samples, 5);
  settings.seed = seed;
  settings.techniques = techniques;
  const BothFilms films = RenderBothFilms(*Compile(t.scene, settings));
  const FrameImage camera = FilmImage(films.camera);
  FrameImage image = camera;
  if (films.light) AddLight(camera, FilmImage(*films.light), settings.window, &image);
  return image;
}

class MergeCoverageTest : public ::testing::TestWithParam<MergeCase> {};

TEST_P(MergeCoverageTest, IntervalsContainTheTruth) {
  const TestScene t = GetParam().make();
  const FrameImage truth = ImageOf(t, TechniqueSet::kCamera, 1'000'003, kSamples * 256);
  const std::vector<float>& expected = *truth.Find("G");
  const float brightest = *std::max_element(expected.begin(), expected.end());
  const auto run_count = static_cast<uint64_t>(DrawCount(12, 200));
  int all = 0, held = 0;
  double widened = 0, noise = 0;
  for (uint64_t seed = 1; seed <= run_count; ++seed) {
    const FrameImage image =
        ImageOf(t, TechniqueSet::kLight.With(Technique::kMerging), seed, kSamples);
    const std::vector<float>& value = *image.Find("G");
    const std::vector<float>& error = *image.Find("stderr.G");
    for (size_t pixel = 0; pixel < value.size(); ++pixel) {
      // Pixels at which the truth is dark, or not known well enough, say nothing.
      if (expected[pixel] < 0.01f * brightest) continue;
      if ((*truth.Find("stderr.G"))[pixel] > 0.3f * error[pixel]) continue;
      ++all;
      const auto off = static_cast<double>(value[pixel] - expected[pixel]);
      if (std::fabs(off) <= kStudentT15 * static_cast<double>(error[pixel])) ++held;
      widened += off;
      noise += static_cast<double>(error[pixel]);
    }
  }
  ASSERT_GT(all, 50 * static_cast<int>(run_count));
  const double fraction = held / static_cast<double>(all);
  std::printf("%s: %.1f %% of %d pixels; mean bias %.3f of the mean error\n",
              GetParam().name.c_str(), 100 * fraction, all, widened / noise);
  EXPECT_GE(fraction, kCoverageMin);
}

INSTANTIATE_TEST_SUITE_P(Scenes, MergeCoverageTest,
                         ::testing::Values(MergeCase{"spot", SpotInMirror},
                                           MergeCase{"shadow", ShadowInMirror},
                                           MergeCase{"glass", FloorUnderGlass}),
                         [](const ::testing::TestParamInfo<MergeCase>& tested) {
                           return tested.param.name;
                         });

}  // namespace
}  // namespace sheaf::render
