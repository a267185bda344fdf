// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests stereo frames: the shift of a path from one eye to the other, and that each eye of a frame
// has the expectation of a render of its own. technique_agreement.h says how they are compared.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "common/film/error/mean_interval.h"
#include "common/film/film.h"
#include "tests/support/technique_agreement.h"
#include "tests/support/technique_scenes.h"
#include "tests/support/test_scene.h"
#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/eyes/specular_prefix.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

using sheaf::testing::Bias;
using sheaf::testing::EstimatesOfTiles;
using sheaf::testing::ExpectAgreement;
using sheaf::testing::kSizePx;
using sheaf::testing::Samples;
using sheaf::testing::TilePair;

constexpr float kEyeDistance = 0.3f, kConvergence = 3;
constexpr Tint kColored{1};
constexpr Eye kEyes[] = {Eye::kLeft, Eye::kRight};

FrameSettings StereoSettings(int32_t size_px, uint64_t samples, float eye_distance = kEyeDistance,
                             float convergence = kConvergence) {
  FrameSettings settings = SquareSettings(size_px, samples, 4);
  settings.width_px *= 2;
  settings.window.x1 *= 2;
  settings.eye_distance = eye_distance;
  settings.eye_convergence = convergence;
  return settings;
}

// The scene as one eye of a stereo frame sees it.
SceneDescription SceneOf(const TestScene& test, Eye eye) {
  SceneDescription scene = test.scene;
  scene.camera = EyeCamera(scene.camera, eye, kEyeDistance, kConvergence);
  return scene;
}

std::vector<testing::Estimate> EstimatesOfEye(const FilmTile& film, Eye eye) {
  const auto at = [&](size_t pixel) {
    const size_t y = pixel / kSizePx, x = pixel % kSizePx;
    return y * 2 * kSizePx + x + (eye == Eye::kRight ? kSizePx : 0);
  };
  return EstimatesOfTiles(
      film.replicate_count(),
      [&](uint32_t r, size_t pixel) {
        double sum = 0;
        for (size_t c = 0; c < 3; ++c) sum += static_cast<double>(film.replicate(r, c)[at(pixel)]);
        return sum;
      },
      [&](uint32_t r, size_t pixel) {
        return static_cast<double>(film.replicate(r, 3)[at(pixel)]);
      });
}

// Both eyes of a stereo frame against a render of each alone.
void ExpectEyesAsAlone(const std::string& name, const std::vector<TestScene>& scenes,
                       uint64_t samples, ColorTransport color = ColorTransport::kRgb) {
  std::vector<TilePair> tiles;
  uint64_t seed = 1000;
  for (const TestScene& scene : scenes) {
    FrameSettings settings = StereoSettings(kSizePx, Samples(samples));
    settings.seed = seed++;
    settings.color = color;
    const CompiledScenePtr both = Compile(scene.scene, settings);
    const FilmTile film = RenderAll(*both);
    for (const Eye eye : kEyes) {
      FrameSettings alone = SquareSettings(kSizePx, Samples(samples), 4);
      alone.seed = seed++;
      alone.color = color;
      const CompiledScenePtr one = Compile(SceneOf(scene, eye), alone);
      const auto of_one = sheaf::testing::EstimatesOf(RenderAll(*one));
      const auto of_both = EstimatesOfEye(film, eye);
      for (size_t t = 0; t < of_one.size(); ++t) tiles.push_back({of_one[t], of_both[t]});
    }
  }
  ExpectAgreement(name, Bias(), tiles);
}

// --- The shift -----------------------------------------------------------------------------------

CompiledScenePtr ShiftScene(float lens_radius) {
  TestScene test = LitRoom(1);
  test.scene.camera.lens_radius = lens_radius;
  test.scene.camera.focal_distance = 1.5f;
  return Compile(test.scene, StereoSettings(64, 1, 0.1f, 2));
}

// A point and its normal in front of both eyes.
SurfacePoint RandomPoint(const CompiledScene& scene, Random* random) {
  const Ray ray = scene.camera.MakeRay<0>({random->Uniform(8, 56), random->Uniform(8, 56)}, {}, 0);
  SurfacePoint point;
  point.p = ray.o + ray.d * static_cast<float>(random->Uniform(0.5, 2));
  point.ng = random->Direction();
  if (std::fabs(Dot(point.ng, ray.d)) < 0.2f) point.ng = -ray.d;
  return point;
}

TEST(EyesTest, PixelsPerAreaAreTheJacobianOfTheFilmPoint) {
  for (const float lens_radius : {0.0f, 0.05f}) {
    const CompiledScenePtr scene = ShiftScene(lens_radius);
    Random random(7);
    for (int i = 0; i < 1000; ++i) {
      SurfacePoint point = RandomPoint(*scene, &random);
      const Vec2f lens{static_cast<float>(random.Uniform()), static_cast<float>(random.Uniform())};
      const Frame frame = Frame::FromNormal(point.ng);
      // Four points around it, rounded to float as the point is, and the normal of their plane.
      constexpr double kStep = 1e-3;
      const auto beside = [&](Vec3f axis, double step) {
        return ToFloat(ToDouble(point.p) + ToDouble(axis) * step);
      };
      const Vec3f a[] = {beside(frame.t, kStep), beside(frame.t, -kStep)};
      const Vec3f b[] = {beside(frame.b, kStep), beside(frame.b, -kStep)};
      const Vec3d cross = Cross(ToDouble(a[0]) - ToDouble(a[1]), ToDouble(b[0]) - ToDouble(b[1]));
      point.ng = ToFloat(Normalize(cross));
      for (const Eye eye : kEyes) {
        Vec3f unused;
        const std::optional<Sight> sight = SightOf(*scene, {eye, lens}, point, &unused);
        ASSERT_TRUE(sight.has_value());
        const auto film = [&](Vec3f p) { return scene->eyes->of(eye).SampleWi(p, lens, 0)->film; };
        const Vec2d of_a = film(a[0]) - film(a[1]), of_b = film(b[0]) - film(b[1]);
        const double pixels = std::fabs(of_a.x * of_b.y - of_a.y * of_b.x) / Length(cross);
        EXPECT_NEAR(sight->pixels / pixels, 1, 1e-4);
      }
    }
  }
}

TEST(EyesTest, AShiftAndItsInverseGiveTheSamePathOrNone) {
  const CompiledScenePtr scene = ShiftScene(0.05f);
  Random random(8);
  int shifted = 0;
  const int path_count = LongTests() ? 1000000 : 100000;
  for (int i = 0; i < path_count; ++i) {
    const Eye eye = i % 2 == 0 ? Eye::kLeft : Eye::kRight;
    const Vec2d film{random.Uniform(0, 64), random.Uniform(0, 64)};
    const Vec2f lens{static_cast<float>(random.Uniform()), static_cast<float>(random.Uniform())};
    const Ray ray = scene->eyes->of(eye).MakeRay<kAllTraits>(film, lens, 0);
    SurfacePoint point;
    point.p = ray.o + ray.d * static_cast<float>(random.Uniform(0.3, 3));
    point.ng = -ray.d;
    Vec3f other_lens, own_lens;
    const auto there = SightOf(*scene, {OtherThan(eye), lens}, point, &other_lens);
    if (!there) continue;
    ++shifted;
    // The other eye's ray through its film point meets the point, and is shifted back.
    const Ray other = scene->eyes->of(OtherThan(eye)).MakeRay<kAllTraits>(there->film, lens, 0);
    const float distance = Length(point.p - other.o);
    point.p = other.o + other.d * distance;
    const auto back = SightOf(*scene, {eye, lens}, point, &own_lens);
    ASSERT_TRUE(back.has_value());
    ASSERT_NEAR(back->film.x, film.x, 2e-4);
    ASSERT_NEAR(back->film.y, film.y, 2e-4);
  }
  EXPECT_GT(shifted, path_count / 2);
}

TEST(EyesTest, EyesConvergeWhereTheyShould) {
  const CompiledScenePtr scene = ShiftScene(0);
  const Ray axis = scene->camera.MakeRay<0>({32, 32}, {}, 0);
  const Vec3f p = axis.o + axis.d * 2.0f;
  for (const Eye eye : kEyes) {
    const Vec2d film = scene->eyes->of(eye).SampleWi(p, {}, 0)->film;
    EXPECT_NEAR(film.x, 32, 1e-4);
    EXPECT_NEAR(film.y, 32, 1e-4);
  }
  // A nearer point is farther to the right for the left eye.
  const Vec3f near = axis.o + axis.d;
  EXPECT_GT(scene->eyes->of(Eye::kLeft).SampleWi(near, {}, 0)->film.x, 32.5);
  EXPECT_LT(scene->eyes->of(Eye::kRight).SampleWi(near, {}, 0)->film.x, 31.5);
}

// Replays the prefixes of random paths in the other eye, and those in the first one.
TEST(EyesTest, AReplayAndItsInverseGiveTheSamePathOrNone) {
  using C = IntegratorConfig<kAllTraits, const EmbreeScene, DirectLight::kByBoth, PathKind::kEye>;
  const CompiledScenePtr scene = Compile(Mirrors({}).scene, StereoSettings(64, 1, 0.1f, 3));
  RayCounts counts;
  LightGroups<Rgb> groups;
  Random random(9);
  int replayed = 0, magnified = 0;
  const int path_count = LongTests() ? 1000000 : 20000;
  for (int i = 0; i < path_count; ++i) {
    const Eye eye = i % 2 == 0 ? Eye::kLeft : Eye::kRight;
    const PathView own{eye}, other{OtherThan(eye)};
    const Sampler sampler(7, i % 64, i / 64 % 64, static_cast<uint64_t>(i), false);
    const Context<C> c{*scene, *scene->tracer, sampler, counts, nullptr, groups, {}, {}};
    SpecularPrefix<C> prefix;
    prefix.origin.eye = eye;
    prefix.length = 1 + static_cast<uint32_t>(i) / 2 % 2;
    // The prefix that begins at the film point of the view.
    const auto end_of = [&](const PathView& view, Vec2d film) -> std::optional<PrefixEnd<C>> {
      const Ray ray = scene->eyes->of(view.eye).MakeRay<kAllTraits>(film, {}, 0);
      RawHit hit;
      if (!scene->tracer->Intersect(ray, &hit)) return std::nullopt;
      prefix.first = MakeSurfacePoint<kAllTraits>(scene->geometry, ray, hit);
      return ReplayPrefix(c, prefix, view, film);
    };
    const auto there = end_of(own, {random.Uniform(0, 64), random.Uniform(0, 64)});
    if (!there) continue;
    Vec3f unused;
    const auto sight = SightOf(*scene, other, prefix.first, &unused);
    if (!sight || !ReplayPrefix(c, prefix, other, sight->film)) continue;
    ASSERT_TRUE(end_of(other, sight->film).has_value());
    const auto back = SightOf(*scene, own, prefix.first, &unused);
    ASSERT_TRUE(back.has_value());
    const auto again = ReplayPrefix(c, prefix, own, back->film);
    ASSERT_TRUE(again.has_value());
    ++replayed;
    const float apart = Length(again->vertex.point.p - there->vertex.point.p);
    EXPECT_LT(apart, 0.2f);
    if (apart > 0.02f) ++magnified;
    EXPECT_NEAR(again->throughput.g, there->throughput.g, 0.02f);
  }
  // Two balls in a row magnify the rounding of the film point where they are grazed.
  EXPECT_LE(magnified, replayed / 10000);
  EXPECT_GT(replayed, path_count / 20);
}

// --- Images --------------------------------------------------------------------------------------

TEST(EyesTest, EyesAreAsAlone) {
  ExpectEyesAsAlone("surfaces", {Diffuse(kColored), Glossy(kColored), ManyLights(kColored)}, 64);
}
TEST(EyesTest, EyesOfOpenScenesAreAsAlone) {
  ExpectEyesAsAlone("sky, lens, cut-outs, motion, media",
                    {Outdoor(kColored), Hazy(kColored), Foggy(kColored)}, 64);
}
TEST(EyesTest, EyesOfSpectralFramesAreAsAlone) {
  ExpectEyesAsAlone("spectral", {Diffuse(kColored), Glossy(kColored)}, 128,
                    ColorTransport::kSpectral);
}

// A narrow strip near the eyes hides a part of the wall from each.
TEST(EyesTest, WhatOneEyeAloneSeesIsAsAlone) {
  TestScene test = Diffuse(kColored);
  test.AddShape(MeshShape{test.Quad({-0.15f, 0, -1.5f}, {-0.15f, 2, -1.5f}, {0.15f, 2, -1.5f},
                                    {0.15f, 0, -1.5f})},
                test.Diffuse({0.2f, 0.2f, 0.2f}));
  ExpectEyesAsAlone("a strip", {test}, 128);
}

TEST(EyesTest, EyesAreAsAloneBehindMirrorsAndGlass) {
  ExpectEyesAsAlone("mirrors and glass", {Mirrors(kColored), Mirrors({})}, 256);
}
TEST(EyesTest, EyesOfSpectralFramesAreAsAloneBehindMirrors) {
  ExpectEyesAsAlone("mirrors in spectral frames", {Mirrors(kColored)}, 256,
                    ColorTransport::kSpectral);
}

TEST(EyesTest, AFurnaceIsWhiteInBothEyes) {
  TestScene test({0, 0, -3}, {0, 0, 0}, 50);
  test.ConstantEnvironment(Rgb::Gray(1));
  test.AddShape(SphereShape{1, -1, 1, 360}, test.Diffuse(Rgb::Gray(1)));
  FrameSettings settings = StereoSettings(16, 64);
  settings.max_depth = 100;
  const CompiledScenePtr scene = Compile(test.scene, settings);
  ExpectMean(MeanOf(RenderAll(*scene)), Rgb::Gray(1));
}

// The variance of an eye over that of one alone, for eyes in one place.
double VarianceInOnePlace(const TestScene& test) {
  const CompiledScenePtr both = Compile(test.scene, StereoSettings(kSizePx, 256, 1e-6f, 0));
  const CompiledScenePtr one = Compile(test.scene, SquareSettings(kSizePx, 256, 4));
  const FilmTile of_both = RenderAll(*both), of_one = RenderAll(*one);
  double ratio_sum = 0;
  for (const Eye eye : kEyes) {
    const auto eyes = EstimatesOfEye(of_both, eye);
    const auto alone = sheaf::testing::EstimatesOf(of_one);
    double eye_variance = 0, variance = 0, difference = 0, mean = 0;
    for (size_t t = 0; t < eyes.size(); ++t) {
      eye_variance += eyes[t].variance;
      variance += alone[t].variance;
      difference += eyes[t].mean - alone[t].mean;
      mean += alone[t].mean;
    }
    EXPECT_NEAR(difference / mean, 0, 0.01);
    ratio_sum += eye_variance / variance;
  }
  std::printf("variance of an eye over that of one alone: %.3f\n", ratio_sum / 2);
  return ratio_sum / 2;
}

// Each has the noise of twice the samples.
TEST(EyesTest, EyesInOnePlaceHaveHalfTheVariance) {
  EXPECT_NEAR(VarianceInOnePlace(Diffuse(kColored)), 0.5, 0.1);
}

// Behind a prefix, the light samples of the first rough vertex are each eye's own.
TEST(EyesTest, EyesInOnePlaceShareLightBehindMirrors) {
  EXPECT_LT(VarianceInOnePlace(Mirrors(kColored)), 0.8);
}

// Where an eye sees the edge of a ball before the sky, shared and unshared paths meet in a pixel.
TEST(EyesTest, CoverageAndDepthAreAsAlone) {
  TestScene test({0, 0, -3}, {0, 0, 0}, 50);
  test.ConstantEnvironment(Rgb::Gray(1));
  test.AddShape(SphereShape{1, -1, 1, 360}, test.Diffuse(Rgb::Gray(0.5f)));
  const CompiledScenePtr both = Compile(test.scene, StereoSettings(16, 1024));
  const FilmTile film = RenderAll(*both);
  for (const Eye eye : kEyes) {
    const CompiledScenePtr one = Compile(SceneOf(test, eye), SquareSettings(16, 1024, 4));
    const FilmTile alone = RenderAll(*one);
    for (size_t p = 0; p < 256; ++p) {
      const size_t at = p / 16 * 32 + p % 16 + (eye == Eye::kRight ? 16 : 0);
      const float weight = film.channel(FilmChannel::kWeight)[at];
      for (const FilmChannel channel : {FilmChannel::kAlpha, FilmChannel::kDepth}) {
        const float mean = film.channel(channel)[at] / weight;
        const float expected = alone.channel(channel)[p] / 1024;
        EXPECT_NEAR(mean, expected, 0.05f + 0.02f * expected) << "pixel " << p;
        if (channel != FilmChannel::kAlpha) continue;
        EXPECT_LE(mean, 1 + 1e-5f);
        if (p == 8 * 16 + 8) {
          EXPECT_NEAR(mean, 1, 1e-5f);
        }
      }
    }
  }
}

// --- Errors --------------------------------------------------------------------------------------

// Renders of one scene with different seeds: in each pixel, 95 % intervals about the values of each
// eye and of their difference cover the mean of the other renders.
TEST(EyesTest, IntervalsOfEyesAndOfTheirDifferenceCoverTheTruth) {
  constexpr int32_t kCoveredPx = 8;
  constexpr size_t kRenders = 48;
  constexpr double kOthers = kRenders - 1;
  const TestScene test = Diffuse(kColored);
  std::vector<FrameImage> images;
  for (size_t i = 0; i < kRenders; ++i) {
    FrameSettings settings = StereoSettings(kCoveredPx, 256);
    settings.seed = 500 + i;
    const CompiledScenePtr scene = Compile(test.scene, settings);
    images.push_back(MakeFrameImage(settings.window, settings.width_px, settings.height_px));
    AddEyeDifference(&images.back());
    DevelopTile(RenderAll(*scene), &images.back());
  }
  const auto value_of = [&](const FrameImage& image, int what, size_t c, size_t p) {
    const auto& plane = image.planes[c];
    const double left = plane[p], right = plane[p + kCoveredPx];
    return what == 0 ? left : what == 1 ? right : left - right;
  };
  const auto error_of = [&](const FrameImage& image, int what, size_t c, size_t p) {
    const std::string component(1, "RGB"[c]);
    if (what == 2) return double{(*image.Find(kEyeDifferenceLayer + ("." + component)))[p]};
    const auto shift = static_cast<size_t>(what * kCoveredPx);
    return double{(*image.Find("stderr." + component))[p + shift]};
  };
  const double quantile = StudentQuantile975(15) * std::sqrt(1 + 1 / kOthers);
  for (int what = 0; what < 3; ++what) {
    double covered = 0, count = 0, variance = 0, told = 0;
    for (size_t c = 0; c < 3; ++c) {
      for (size_t at = 0; at < size_t{kCoveredPx} * kCoveredPx; ++at) {
        const size_t p = at / kCoveredPx * 2 * kCoveredPx + at % kCoveredPx;
        double sum = 0;
        for (const FrameImage& image : images) sum += value_of(image, what, c, p);
        for (const FrameImage& image : images) {
          const double value = value_of(image, what, c, p), error = error_of(image, what, c, p);
          const double off = value - (sum - value) / kOthers;
          covered += std::fabs(off) <= quantile * error ? 1 : 0;
          variance += off * off / (1 + 1 / kOthers);
          told += error * error;
          ++count;
        }
      }
    }
    const char* const names[] = {"left eye", "right eye", "difference"};
    std::printf("%s: coverage %.4f, told over true variance %.3f\n", names[what], covered / count,
                told / variance);
    EXPECT_GE(covered / count, 0.93) << names[what];
    EXPECT_LE(covered / count, 0.97) << names[what];
  }
}

// Passes of one block are those of its halves.
TEST(EyesTest, BlocksAreMergedToTheSameBits) {
  const CompiledScenePtr scene = Compile(Diffuse(kColored).scene, StereoSettings(16, 8));
  const PixelRect film = SettingsOf(*scene).window;
  const auto part = [&](uint64_t first, uint64_t count) {
    return *RenderTilePass(*scene, film, {first, count}, {}, nullptr);
  };
  const FilmTile whole = part(0, 8);
  EXPECT_EQ(MergeSiblings(MergeSiblings(part(0, 2), part(2, 2)), part(4, 4)), whole);
  EXPECT_FALSE(RenderTilePass(*scene, {0, 0, 16, 16}, {0, 8}, {}, nullptr).ok());
}

// A filter with negative values, that reaches beyond a pixel.
TEST(EyesTest, WideFiltersKeepTheMean) {
  TestScene test = Diffuse(kColored);
  test.scene.filter.kind = FilterDescription::Kind::kMitchell;
  test.scene.filter.radius_x_px = test.scene.filter.radius_y_px = 2;
  const CompiledScenePtr both = Compile(test.scene, StereoSettings(kSizePx, 256));
  const TileMean mean = MeanOf(RenderAll(*both));
  Rgb alone{};
  Rgb error{};
  for (const Eye eye : kEyes) {
    const CompiledScenePtr one = Compile(SceneOf(test, eye), SquareSettings(kSizePx, 256, 4));
    const TileMean of_eye = MeanOf(RenderAll(*one));
    alone += of_eye.mean * 0.5f;
    error += of_eye.standard_error * 0.5f;
  }
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(mean.mean[c], alone[c], 5 * (mean.standard_error[c] + error[c])) << c;
  }
}

}  // namespace
}  // namespace sheaf::render
