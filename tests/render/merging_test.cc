// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests of light that is found by merging light paths with camera paths: a closed form, a view in a
// mirror against the same seen directly, and camera paths where they find the light too.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "common/film/task_kind.h"
#include "tests/support/light_film_sums.h"
#include "tests/support/technique_agreement.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"
#include "worker/render/bsdf/fresnel.h"

namespace sheaf::render {
namespace {

using sheaf::testing::Bias;
using sheaf::testing::EstimatesOfTiles;
using sheaf::testing::ExpectAgreement;
using sheaf::testing::kSizePx;
using sheaf::testing::Samples;
using sheaf::testing::TilePair;
using testing::Estimate;

const TechniqueSet kBoth = TechniqueSet::kCameraAndLight.With(Technique::kMerging);
const TechniqueSet kAlone = TechniqueSet::kLight.With(Technique::kMerging);

struct Rendering {
  TechniqueSet techniques = TechniqueSet::kCamera;
  uint64_t seed = 0, samples = 64;
  int32_t depth = 8;
  ColorTransport color = ColorTransport::kRgb;
};

BothFilms Render(const TestScene& test_scene, const Rendering& rendering) {
  FrameSettings settings = SquareSettings(kSizePx, rendering.samples, rendering.depth);
  settings.seed = rendering.seed;
  settings.color = rendering.color;
  settings.techniques = rendering.techniques;
  return RenderBothFilms(*Compile(test_scene.scene, settings));
}

// The tiles of an image, or of one that is turned about its vertical axis.
std::vector<Estimate> EstimatesOf(const BothFilms& films, bool turned = false) {
  return EstimatesOfTiles(
      kReplicateCount,
      [&](uint32_t r, size_t pixel) {
        if (turned) pixel += kSizePx - 1 - 2 * (pixel % kSizePx);
        return films.Mean(r, 0, pixel) + films.Mean(r, 1, pixel) + films.Mean(r, 2, pixel);
      },
      [](uint32_t, size_t) { return 1.0; });
}

void AddPairs(const std::vector<Estimate>& a, const std::vector<Estimate>& b,
              std::vector<TilePair>* tiles) {
  for (size_t i = 0; i < a.size(); ++i) tiles->push_back({a[i], b[i]});
}

// The fraction of light that a sheet of smooth glass reflects, with all reflections between its two
// sides.
double SheetReflectance(double cosine) {
  const auto once =
      static_cast<double>(FresnelDielectric(static_cast<float>(cosine), 1.5f).reflectance);
  return 2 * once / (1 + once);
}
// The same of light from all directions.
double DiffuseSheetReflectance() {
  constexpr int kSteps = 10'000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) sum += SheetReflectance(std::sqrt((i + 0.5) / kSteps)) / kSteps;
  return sum;
}

// A diffuse plane under a slab of glass, seen from above and lit by the sun, which no camera path
// finds. Both are wide against the distance between them.
TEST(MergingTest, PlaneUnderGlassHasItsIrradiance) {
  constexpr float kReflectance = 0.4f, kSun = 3;
  constexpr double kCosine = 0.8;
  TestScene t({0, 4, 0}, {0, 0, 0}, 36, {0, 0, 1});
  t.AddShape(MeshShape{t.Quad({-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2})},
             t.Diffuse(Rgb::Gray(kReflectance)));
  t.AddShape(MeshShape{t.Box({-2, 0.05f, -2}, {2, 0.1f, 2})}, t.AddMaterial(DielectricMaterial{}));
  DistantLight sun;
  sun.radiance.rgb = Rgb::Gray(kSun);
  sun.from = {std::sqrt(1 - kCosine * kCosine), kCosine, 0};
  sun.to = {0, 0, 0};
  t.scene.lights.push_back({sun, {}, {}, {}});
  const double irradiance = kSun * kCosine * (1 - SheetReflectance(kCosine)) /
                            (1 - static_cast<double>(kReflectance) * DiffuseSheetReflectance());
  const double expected =
      irradiance * static_cast<double>(kReflectance) / kPi * (1 - SheetReflectance(1));
  for (const TechniqueSet techniques : {kBoth, kAlone}) {
    const BothFilms films = Render(t, {.techniques = techniques, .samples = 128, .depth = 40});
    const ComponentMean mean = MeanOverPixels(films, 1);
    EXPECT_NEAR(mean.value, expected, 4 * mean.standard_error + 1e-3 * expected);
    EXPECT_LT(mean.standard_error, 5e-3 * expected);
    EXPECT_LT(MeanOf(films.camera).mean.g, 1e-4 * expected);
  }
  // Without merging nothing finds it, but for a trace at the borders.
  EXPECT_LT(MeanOverPixels(Render(t, {.techniques = TechniqueSet::kCameraAndLight}), 1).value,
            1e-4 * expected);
}

// A plane under a lamp, and the image of the plane in a mirror at x = 0.
TEST(MergingTest, MirrorShowsWhatIsSeenDirectly) {
  const Vec3d eye{-1, 1.5, -2}, at{1.2, 0, 0.75};
  const auto make = [&](bool in_mirror) {
    // The plane is at x > 0 where it is seen directly, and at x < 0 in front of the mirror.
    const float side = in_mirror ? -1 : 1;
    TestScene t(eye, at, 14);
    t.AddShape(MeshShape{t.Box({side * 1.5f - 1.5f, -0.1f, -3}, {side * 1.5f + 1.5f, 0, 3})},
               t.Diffuse({0.7f, 0.6f, 0.5f}));
    const float x = side * 1.1f, w = 0.3f;
    t.AddShape(MeshShape{t.Quad({x - w, 0.8f, 0.3f}, {x + w, 0.8f, 0.3f}, {x + w, 0.8f, 0.9f},
                                {x - w, 0.8f, 0.9f})},
               t.Diffuse({}))
        .area_light = t.AreaLight({6, 5, 4});
    if (in_mirror) {
      ConductorMaterial mirror;
      mirror.has_reflectance = true;
      mirror.reflectance.value.rgb = Rgb::Gray(1);
      t.AddShape(MeshShape{t.Quad({0, -1, -4}, {0, -1, 4}, {0, 4, 4}, {0, 4, -4})},
                 t.AddMaterial(mirror));
    }
    return t;
  };
  std::vector<TilePair> tiles;
  for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
    // The mirror is one event more, and shows light that it reflects only with two more.
    const BothFilms direct = Render(make(false), {.techniques = TechniqueSet::kLight,
                                                  .seed = 1,
                                                  .samples = Samples(256),
                                                  .depth = 1,
                                                  .color = color});
    const BothFilms mirrored = Render(
        make(true),
        {.techniques = kAlone, .seed = 2, .samples = Samples(256), .depth = 2, .color = color});
    EXPECT_EQ(MeanOf(mirrored.camera).mean.g, 0);
    AddPairs(EstimatesOf(direct), EstimatesOf(mirrored), &tiles);
  }
  ExpectAgreement("mirror", 2 * Bias(), tiles);
}

// Glass above a floor under a large lamp.
TestScene GlassOnFloor(bool is_varnished) {
  TestScene t({0, 1.6, -3}, {0, 0.4, 0}, 24);
  CoatedDiffuseMaterial varnish;
  varnish.roughness = {{0.3f, kNone}, {0.3f, kNone}, true};
  varnish.reflectance.value.rgb = Rgb::Gray(0.6f);
  const int32_t floor = is_varnished ? t.AddMaterial(varnish) : t.Diffuse(Rgb::Gray(0.6f));
  t.AddShape(MeshShape{t.Quad({-3, 0, -3}, {-3, 0, 3}, {3, 0, 3}, {3, 0, -3})}, floor);
  t.AddShape(MeshShape{t.Quad({-1.5f, 2.5f, -1.5f}, {1.5f, 2.5f, -1.5f}, {1.5f, 2.5f, 1.5f},
                              {-1.5f, 2.5f, 1.5f})},
             t.Diffuse({}))
      .area_light = t.AreaLight({3, 3, 3});
  t.AddShape(SphereShape{0.5f, -0.5f, 0.5f, 360}, t.AddMaterial(DielectricMaterial{}),
             TranslateMatrix({0.6, 0.7, 0}));
  t.AddShape(MeshShape{t.Box({-1.2f, 0.3f, -0.5f}, {-0.2f, 0.5f, 0.5f})},
             t.AddMaterial(DielectricMaterial{}));
  return t;
}

TEST(MergingTest, BothKindsFindWhatTheCameraFinds) {
  for (const TechniqueSet techniques : {kBoth, kAlone}) {
    std::vector<TilePair> tiles;
    for (const ColorTransport color : {ColorTransport::kRgb, ColorTransport::kSpectral}) {
      const TestScene t = GlassOnFloor(color == ColorTransport::kSpectral);
      const BothFilms camera = Render(t, {.seed = 10, .samples = Samples(128), .color = color});
      const BothFilms merged = Render(
          t, {.techniques = techniques, .seed = 11, .samples = Samples(128), .color = color});
      AddPairs(EstimatesOf(camera), EstimatesOf(merged), &tiles);
    }
    ExpectAgreement("glass", (techniques == kBoth ? 2 : 4) * Bias(), tiles);
  }
}

// The pixels about the middle of a square image.
std::vector<size_t> MiddleOf(int32_t size_px) {
  std::vector<size_t> pixels;
  for (int32_t y = 11 * size_px / 24; y < 13 * size_px / 24; ++y) {
    for (int32_t x = 11 * size_px / 24; x < 13 * size_px / 24; ++x) {
      pixels.push_back(static_cast<size_t>(y * size_px + x));
    }
  }
  return pixels;
}

// The mean of the estimate of bias over pixels, for one color component.
double MeanBias(const FilmTile& light, size_t component, const std::vector<size_t>& pixels) {
  const size_t mean = light.mean_count() - kMergeBiasMeanCount + component;
  double sum = 0;
  for (const size_t pixel : pixels) sum += static_cast<double>(light.mean(mean, 0)[pixel]);
  return sum / static_cast<double>(pixels.size() * light.block().count);
}

// A small bright spot under a lamp without size, seen in a mirror: its peak is blurred. Camera
// paths know the truth, at two radii: the image of half the size has twice the footprint.
TEST(MergingTest, BiasIsThatOfTheLayer) {
  TestScene t({-1, 1.5, -2}, {1, 0, 0.5}, 25);
  t.AddShape(MeshShape{t.Box({-3, -0.1f, -2}, {-0.1f, 0, 3})}, t.Diffuse(Rgb::Gray(0.7f)));
  ConductorMaterial mirror;
  mirror.has_reflectance = true;
  mirror.reflectance.value.rgb = Rgb::Gray(1);
  t.AddShape(MeshShape{t.Quad({0, -1, -4}, {0, -1, 4}, {0, 4, 4}, {0, 4, -4})},
             t.AddMaterial(mirror));
  SpotLight lamp;
  lamp.intensity.rgb = Rgb::Gray(1);
  lamp.from = {-1, 0.2, 0.5};
  lamp.to = {-1, 0, 0.5};
  lamp.cone_angle_degrees = 60;
  lamp.cone_delta_angle_degrees = 1;
  t.scene.lights.push_back({lamp, {}, {}, {}});
  for (const int32_t size_px : {24, 48}) {
    FrameSettings settings = SquareSettings(size_px, 256, 2);
    const ComponentMean truth =
        MeanOverPixels(RenderBothFilms(*Compile(t.scene, settings)), 1, MiddleOf(size_px));
    settings.techniques = kAlone;
    const BothFilms films = RenderBothFilms(*Compile(t.scene, settings));
    const ComponentMean merged = MeanOverPixels(films, 1, MiddleOf(size_px));
    const double bias = merged.value - truth.value;
    const double estimate = MeanBias(*films.light, 1, MiddleOf(size_px));
    std::printf("%d px: bias %.4f of %.4f +- %.4f, estimate %.4f\n", size_px, bias, truth.value,
                merged.standard_error, estimate);
    EXPECT_LT(bias, -4 * merged.standard_error);
    EXPECT_NEAR(estimate, bias, 0.25 * std::fabs(bias) + 2 * merged.standard_error);
  }
}

}  // namespace
}  // namespace sheaf::render
