// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests frames whose pixels share paths: the sets of views, the shift of a path between them, and
// that images have the expectation of paths that count in one pixel. technique_agreement.h says how
// they are compared. eyes_test.cc tests the two eyes of stereo frames.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/support/lenses.h"
#include "tests/support/technique_agreement.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"
#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/eyes/shared_vertex.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

using sheaf::testing::Bias;
using sheaf::testing::Estimate;
using sheaf::testing::EstimatesOf;
using sheaf::testing::ExpectAgreement;
using sheaf::testing::kSizePx;
using sheaf::testing::Samples;
using sheaf::testing::TilePair;

constexpr TechniqueSet kByFilter{Technique::kSharing};
constexpr TechniqueSet kByViews{Technique::kSharing, Technique::kViews};
constexpr Tint kTinted{1};

FrameSettings SharingSettings(int32_t size_px, uint64_t samples, TechniqueSet techniques) {
  FrameSettings settings = SquareSettings(size_px, samples, 4);
  settings.techniques = techniques;
  return settings;
}

// Points at all distances but 1.5 are blurred, at the farthest over a quarter of the image.
TestScene ThroughLens(TestScene test) {
  test.scene.camera.lens_radius = 0.25f;
  test.scene.camera.focal_distance = 1.5f;
  return test;
}
// The camera moves to the side and turns.
TestScene OverShutter(TestScene test) {
  test.scene.camera.shutter_open = 0;
  test.scene.camera.shutter_close = 1;
  const Matrix4 start = test.scene.camera.world_from_camera.start;
  test.SetCamera({0.5, 1.1, -3.1}, {0.1, 0.6, 0}, 36);
  test.scene.camera.world_from_camera.start = start;
  return test;
}
// The same blur through a lens of glass, whose rays have weights.
TestScene ThroughGlass(TestScene test) {
  CameraDescription& camera = test.scene.camera;
  camera.kind = CameraDescription::Kind::kRealistic;
  camera.lens = sheaf::testing::DoubleGauss();
  camera.lens.aperture_diameter_mm = 25;
  camera.lens.film_diagonal_mm = 40;
  camera.lens.focus_distance_m = 0.4f;
  return test;
}
TestScene WithFilter(TestScene test, FilterDescription::Kind kind, float radius_px) {
  test.scene.filter.kind = kind;
  test.scene.filter.radius_x_px = test.scene.filter.radius_y_px = radius_px;
  return test;
}

// Shared paths against those that count in one pixel.
void ExpectAsAlone(const std::string& name, const std::vector<TestScene>& scenes, uint64_t samples,
                   TechniqueSet techniques = kByViews,
                   ColorTransport color = ColorTransport::kRgb) {
  std::vector<TilePair> tiles;
  uint64_t seed = 2000;
  for (const TestScene& scene : scenes) {
    const auto estimates = [&](TechniqueSet set) {
      FrameSettings settings = SharingSettings(kSizePx, Samples(samples), set);
      settings.seed = seed++;
      settings.color = color;
      return EstimatesOf(RenderAll(*Compile(scene.scene, settings)));
    };
    const std::vector<Estimate> shared = estimates(techniques);
    const std::vector<Estimate> alone = estimates(TechniqueSet::kCamera);
    for (size_t t = 0; t < alone.size(); ++t) tiles.push_back({alone[t], shared[t]});
  }
  ExpectAgreement(name, Bias(), tiles);
}

// --- Sets of views -------------------------------------------------------------------------------

PathOrigin RandomOrigin(Random* random) {
  return {Eye::kLeft,
          {static_cast<float>(random->Uniform()), static_cast<float>(random->Uniform())},
          static_cast<float>(random->Uniform())};
}

// The distance of two numbers modulo 1.
double Apart(float a, float b) {
  const double apart = std::fabs(static_cast<double>(a) - static_cast<double>(b));
  return std::min(apart, 1 - apart);
}

TEST(SharingTest, EveryViewOfASetHasTheSameSet) {
  const CompiledScenePtr scene =
      Compile(OverShutter(ThroughLens(LitRoom(1))).scene, SharingSettings(64, 1, kByViews));
  const PathSharing sharing = SharingOf(*scene);
  ASSERT_TRUE(sharing.through_lens && sharing.over_shutter && sharing.by_filter);
  Random random(3);
  for (int n = 0; n < 1000; ++n) {
    const PathOrigin origin = RandomOrigin(&random);
    for (const int32_t count : {1, 2, 4, 8}) {
      for (int32_t i = 0; i < count; ++i) {
        const PathView view = ViewOf(*scene, sharing, origin, Eye::kLeft, count, i);
        ASSERT_TRUE(view.lens.x >= 0 && view.lens.x < 1 && view.lens.y >= 0 && view.lens.y < 1);
        ASSERT_TRUE(view.time >= 0 && view.time < 1);
        // The origin is a view of the set of each of its views.
        const PathOrigin other{Eye::kLeft, view.lens, view.time};
        const PathView back = ViewOf(*scene, sharing, other, Eye::kLeft, count, count - i);
        ASSERT_LT(Apart(back.lens.x, origin.lens.x), 1e-6);
        ASSERT_LT(Apart(back.lens.y, origin.lens.y), 1e-6);
        ASSERT_LT(Apart(back.time, origin.time_u), 1e-6);
        // All differ.
        if (i > 0) {
          ASSERT_GT(Apart(view.lens.x, origin.lens.x), 0.1);
          ASSERT_GT(Apart(view.time, origin.time_u), 0.1);
        }
      }
    }
  }
}

TEST(SharingTest, PointsOfTheDiskTellTheirSample) {
  Random random(4);
  for (int n = 0; n < 10000; ++n) {
    const Vec2f u{static_cast<float>(random.Uniform()), static_cast<float>(random.Uniform())};
    const Vec2f back = UnitSquareOfDisk(SampleUnitDisk(u));
    ASSERT_NEAR(back.x, u.x, 1e-6);
    ASSERT_NEAR(back.y, u.y, 1e-6);
  }
}

TEST(SharingTest, ViewsAreAsManyAsTheBlurIsWide) {
  const CompiledScenePtr lens =
      Compile(ThroughLens(LitRoom(1)).scene, SharingSettings(64, 1, kByViews));
  const auto shares = [](const CompiledScene& scene, float z) {
    const Ray axis = scene.camera.MakeRay<0>({32, 32}, {}, 0);
    return SharesAt(scene, SharingOf(scene), axis.o + axis.d * z, 0);
  };
  EXPECT_EQ(shares(*lens, 1.5f), 1);
  EXPECT_EQ(shares(*lens, 100), 8);
  EXPECT_LT(shares(*lens, 1.6f), shares(*lens, 3));
  const CompiledScenePtr by_filter =
      Compile(ThroughLens(LitRoom(1)).scene, SharingSettings(64, 1, kByFilter));
  EXPECT_EQ(shares(*by_filter, 100), 1);
  const CompiledScenePtr moving =
      Compile(OverShutter(LitRoom(1)).scene, SharingSettings(64, 1, kByViews));
  EXPECT_GT(shares(*moving, 1), 1);
}

// A path at another time would meet another world.
TEST(SharingTest, TimesShareNoPathsOfAWorldThatMoves) {
  TestScene test = OverShutter(Diffuse(kTinted));
  const auto over_shutter = [](const TestScene& scene) {
    return SharingOf(*Compile(scene.scene, SharingSettings(16, 1, kByViews))).over_shutter;
  };
  EXPECT_TRUE(over_shutter(test));
  test.scene.shapes.back().world_from_object.end = TranslateMatrix({0, 1, 0});
  EXPECT_FALSE(over_shutter(test));
}

// --- The shift -----------------------------------------------------------------------------------

TEST(SharingTest, AShiftAndItsInverseGiveTheSamePathOrNone) {
  const CompiledScenePtr scene =
      Compile(OverShutter(ThroughLens(LitRoom(1))).scene, SharingSettings(64, 1, kByViews));
  const PathSharing sharing = SharingOf(*scene);
  Random random(8);
  int shifted = 0;
  const int path_count = LongTests() ? 1000000 : 100000;
  for (int n = 0; n < path_count; ++n) {
    const PathOrigin origin = RandomOrigin(&random);
    const PathView view = ViewOf(*scene, sharing, origin, Eye::kLeft, 8, 0);
    const Vec2d film{random.Uniform(0, 64), random.Uniform(0, 64)};
    const Ray ray = scene->camera.MakeRay<kAllTraits>(film, view.lens, view.time);
    SurfacePoint point;
    point.p = ray.o + ray.d * static_cast<float>(random.Uniform(0.3, 3));
    point.ng = -ray.d;
    const int32_t i = 1 + n % 7;
    const PathView other = ViewOf(*scene, sharing, origin, Eye::kLeft, 8, i);
    Vec3f lens;
    const std::optional<Sight> there = SightOf(*scene, other, point, &lens);
    if (!there) continue;
    ++shifted;
    // The other view's ray through its film point meets the point, and is shifted back.
    const Ray back_ray = scene->camera.MakeRay<kAllTraits>(there->film, other.lens, other.time);
    point.p = back_ray.o + back_ray.d * Length(point.p - back_ray.o);
    const std::optional<Sight> back = SightOf(*scene, view, point, &lens);
    ASSERT_TRUE(back.has_value());
    ASSERT_NEAR(back->film.x, film.x, 1e-3);
    ASSERT_NEAR(back->film.y, film.y, 1e-3);
  }
  EXPECT_GT(shifted, path_count / 2);
}

// --- Images --------------------------------------------------------------------------------------

TEST(SharingTest, PathsThroughALensAreAsAlone) {
  ExpectAsAlone("lens",
                {ThroughLens(Diffuse(kTinted)), ThroughLens(Glossy(kTinted)),
                 ThroughLens(ManyLights(kTinted))},
                64);
}
TEST(SharingTest, PathsThroughGlassAreAsAlone) {
  const CompiledScenePtr scene =
      Compile(ThroughGlass(Diffuse(kTinted)).scene, SharingSettings(kSizePx, 1, kByViews));
  const PathSharing sharing = SharingOf(*scene);
  ASSERT_TRUE(sharing.through_lens);
  const Ray axis = scene->camera.MakeRay<kAllTraits>({24, 24}, {0.5f, 0.5f}, 0);
  EXPECT_GT(SharesAt(*scene, sharing, axis.o + axis.d * 4.0f, 0), 1);
  ExpectAsAlone("a lens of glass", {ThroughGlass(Diffuse(kTinted)), ThroughGlass(Glossy(kTinted))},
                256);
}
TEST(SharingTest, PathsBehindMirrorsAreAsAlone) {
  TestScene test = Diffuse(kTinted);
  ConductorMaterial mirror;
  mirror.has_reflectance = true;
  mirror.reflectance.value.rgb = {0.9f, 0.8f, 0.7f};
  constexpr size_t kBackWall = 1;  // As OpenBox adds it.
  test.scene.shapes[kBackWall].material = test.AddMaterial(mirror);
  ExpectAsAlone("mirror through a lens", {ThroughLens(test), ThroughLens(test)}, 512);
}
TEST(SharingTest, PathsOverAShutterAreAsAlone) {
  ExpectAsAlone("shutter",
                {OverShutter(Diffuse(kTinted)), OverShutter(Glossy(kTinted)),
                 ThroughLens(OverShutter(Diffuse(kTinted)))},
                64);
}
TEST(SharingTest, PathsOfOpenScenesAreAsAlone) {
  ExpectAsAlone("sky, lens, cut-outs, motion, media",
                {ThroughLens(Outdoor(kTinted)), ThroughLens(Hazy(kTinted)), Foggy(kTinted)}, 64);
}
TEST(SharingTest, PathsOfSpectralFramesAreAsAlone) {
  ExpectAsAlone("spectral", {ThroughLens(Diffuse(kTinted)), ThroughLens(Glossy(kTinted))}, 128,
                kByViews, ColorTransport::kSpectral);
}
TEST(SharingTest, PathsBehindFiltersAreAsAlone) {
  using Kind = FilterDescription::Kind;
  ExpectAsAlone("filters",
                {WithFilter(Diffuse(kTinted), Kind::kGaussian, 1.5f),
                 WithFilter(Glossy(kTinted), Kind::kTriangle, 2)},
                64, kByFilter);
  ExpectAsAlone("filters and lens",
                {ThroughLens(WithFilter(Diffuse(kTinted), Kind::kGaussian, 1.5f)),
                 ThroughLens(WithFilter(Glossy(kTinted), Kind::kMitchell, 2))},
                64);
}

// A narrow strip near the camera hides a part of the wall from each point of the lens.
TEST(SharingTest, WhatAPartOfTheLensSeesIsAsAlone) {
  TestScene test = ThroughLens(Diffuse(kTinted));
  test.AddShape(MeshShape{test.Quad({-0.15f, 0, -1.5f}, {-0.15f, 2, -1.5f}, {0.15f, 2, -1.5f},
                                    {0.15f, 0, -1.5f})},
                test.Diffuse({0.2f, 0.2f, 0.2f}));
  ExpectAsAlone("a strip", {test}, 512);
}

// Eyes, lens and shutter at once.
TEST(SharingTest, EyesShareThemToo) {
  const TestScene test = OverShutter(ThroughLens(Diffuse(kTinted)));
  FrameSettings settings = SharingSettings(kSizePx, 128, kByViews);
  settings.width_px *= 2;
  settings.window.x1 *= 2;
  settings.eye_distance = 0.3f;
  settings.eye_convergence = 3;
  const TileMean both = MeanOf(RenderAll(*Compile(test.scene, settings)));
  settings.techniques = TechniqueSet::kCamera;
  settings.seed = 1;
  const TileMean alone = MeanOf(RenderAll(*Compile(test.scene, settings)));
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(both.mean[c], alone.mean[c],
                5 * (both.standard_error[c] + alone.standard_error[c]));
  }
}

TEST(SharingTest, AFurnaceIsWhite) {
  TestScene test({0, 0, -3}, {0, 0, 0}, 50);
  test.ConstantEnvironment(Rgb::Gray(1));
  test.AddShape(SphereShape{1, -1, 1, 360}, test.Diffuse(Rgb::Gray(1)));
  FrameSettings settings = SharingSettings(16, 64, kByViews);
  settings.max_depth = 100;
  ExpectMean(MeanOf(RenderAll(*Compile(ThroughLens(test).scene, settings))), Rgb::Gray(1));
}

// Where the image is blurred over many pixels, each of them has the paths of several.
TEST(SharingTest, BlurredPixelsHaveLessNoise) {
  const auto mean_variance = [](const TestScene& test, TechniqueSet techniques) {
    double sum = 0;
    const CompiledScenePtr scene = Compile(test.scene, SharingSettings(kSizePx, 256, techniques));
    const FilmTile film = RenderAll(*scene);
    constexpr size_t kPixels = static_cast<size_t>(kSizePx) * kSizePx;
    for (size_t p = 0; p < kPixels; ++p) {
      double first = 0, second = 0;
      for (uint32_t r = 0; r < kReplicateCount; ++r) {
        const double value = static_cast<double>(film.replicate(r, 1)[p]) /
                             static_cast<double>(film.replicate(r, 3)[p]);
        first += value / kReplicateCount;
        second += value * value / kReplicateCount;
      }
      sum += second - first * first;
    }
    return sum / kPixels;
  };
  const TestScene blurred = ThroughLens(Diffuse(kTinted));
  const double gain =
      mean_variance(blurred, TechniqueSet::kCamera) / mean_variance(blurred, kByViews);
  std::printf("variance of pixels of one path over that of shared ones: %.2f\n", gain);
  EXPECT_GT(gain, 1.6);
  const TestScene wide = WithFilter(Diffuse(kTinted), FilterDescription::Kind::kGaussian, 1.5f);
  const double by_filter =
      mean_variance(wide, TechniqueSet::kCamera) / mean_variance(wide, kByFilter);
  std::printf("the same behind a Gaussian filter: %.2f\n", by_filter);
  EXPECT_GT(by_filter, 1.6);
}

// Nothing to share: the same paths, in the same pixels.
TEST(SharingTest, FramesWithoutBlurKeepTheirMean) {
  const TestScene test = Diffuse(kTinted);
  const FilmTile shared = RenderAll(*Compile(test.scene, SharingSettings(kSizePx, 4, kByViews)));
  const FilmTile alone =
      RenderAll(*Compile(test.scene, SharingSettings(kSizePx, 4, TechniqueSet::kCamera)));
  for (size_t p = 0; p < static_cast<size_t>(kSizePx) * kSizePx; ++p) {
    for (uint32_t r = 0; r < 4; ++r) {
      ASSERT_NEAR(shared.replicate(r, 1)[p], alone.replicate(r, 1)[p],
                  1e-5 * (1 + static_cast<double>(alone.replicate(r, 1)[p])));
    }
  }
}

TEST(SharingTest, BlocksAreMergedToTheSameBits) {
  const CompiledScenePtr scene =
      Compile(ThroughLens(Diffuse(kTinted)).scene, SharingSettings(16, 8, kByViews));
  const PixelRect film = SettingsOf(*scene).window;
  const auto part = [&](uint64_t first, uint64_t count) {
    return *RenderTilePass(*scene, film, {first, count}, {}, nullptr);
  };
  EXPECT_EQ(MergeSiblings(MergeSiblings(part(0, 2), part(2, 2)), part(4, 4)), part(0, 8));
  EXPECT_FALSE(RenderTilePass(*scene, {0, 0, 8, 16}, {0, 8}, {}, nullptr).ok());
}

}  // namespace
}  // namespace sheaf::render
