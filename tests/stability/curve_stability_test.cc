// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of curves, named as in the catalogue. Cases with a single ray and segment are in
// worker/render/geometry/curve_test.cc.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <memory>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/naive_geometry.h"
#include "tests/support/test_scene.h"
#include "tests/support/traced_scene.h"
#include "worker/render/geometry/surface_point.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {
namespace {

using Kind = CurveSet::Kind;
constexpr Kind kKinds[] = {Kind::kFlat, Kind::kCylinder, Kind::kRibbon};

TestScene AtOrigin() { return TestScene({0, 0, 0}, {0, 0, 1}, 60); }

void AddSegment(CurveSet* set, const std::array<Vec3f, 4>& points, float width0, float width1) {
  set->points.insert(set->points.end(), points.begin(), points.end());
  set->widths.insert(set->widths.end(), {width0, width1});
  if (set->kind == Kind::kRibbon) {
    set->normals.insert(set->normals.end(), {Vec3f{0, 0, 1}, Vec3f{0, 0.6f, 0.8f}});
  }
}
CurveSet StraightCurve(Kind kind, Vec3f from, Vec3f to, float width) {
  CurveSet set;
  set.kind = kind;
  AddSegment(&set, {from, from + (to - from) * (1 / 3.0f), from + (to - from) * (2 / 3.0f), to},
             width, width);
  return set;
}
// `count` irregular curves within a cube of half-size 1.
CurveSet Tangle(Kind kind, int count, double width, uint64_t seed) {
  CurveSet set;
  set.kind = kind;
  Random random(seed);
  for (int i = 0; i < count; ++i) {
    const Vec3f root = random.Direction() * 0.5f, step = random.Direction() * 0.3f;
    const auto bend = [&] { return random.Direction() * 0.1f; };
    AddSegment(&set, {root, root + step + bend(), root + step * 2.0f + bend(), root + step * 3.0f},
               static_cast<float>(width), static_cast<float>(width * random.Uniform(0, 1)));
  }
  return set;
}
CurveShape AddCurves(TestScene* t, CurveSet set) {
  t->scene.curve_sets.push_back(std::move(set));
  return {static_cast<int32_t>(t->scene.curve_sets.size() - 1)};
}

// G1, G10: rays that leave a straight curve never hit it, for every kind, position, size and
// scaling.
TEST(CurveStability, G10SpawnedRaysDoNotHitTheirCurve) {
  Random random(1);
  int spawned = 0, self_hits = 0, offset_hits = 0;
  for (int i = 0; i < 3000; ++i) {
    TestScene t = AtOrigin();
    const double length = std::pow(10.0, random.Uniform(-3, 5));
    const double width = length * std::pow(10.0, random.Uniform(-5, -1));
    const Vec3d center = ToDouble(random.Direction()) * std::pow(10.0, random.Uniform(-3, 6));
    const Matrix4 place = TranslateMatrix(center) *
                          RotateMatrix(random.Uniform(0, 360), ToDouble(random.Direction())) *
                          ScaleMatrix({random.Uniform(0.5, 2), random.Uniform(0.5, 2),
                                       random.Uniform() < 0.5 ? 1.0 : -1.0});
    const auto half = static_cast<float>(0.5 * length);
    t.AddShape(AddCurves(&t, StraightCurve(kKinds[i % 3], {-half, 0, 0}, {half, 0, 0},
                                           static_cast<float>(width))),
               kNone, place)
        .reverse_orientation = i % 2 == 0;
    const std::unique_ptr<TracedScene> scene = Traced(t.scene);
    const Vec3f side = random.Direction();
    const Vec3d aim = TransformPoint(
        place, {length * random.Uniform(-0.4, 0.4), width * random.Uniform(-0.4, 0.4),
                width * random.Uniform(-0.4, 0.4)});
    SurfacePoint point;
    if (!HitTowards(*scene, ToFloat(aim + ToDouble(side) * length), ToFloat(aim), &point)) continue;
    for (int k = 0; k < 200; ++k) {
      const Ray away = Spawned(point, random.Direction());
      RawHit hit;
      ++spawned;
      self_hits += scene->tracer->Intersect(away, &hit) || scene->tracer->Occluded(away);
      Ray naive;
      naive.o = naive::OffsetOrigin(point.p, point.ng, away.d);
      naive.d = away.d;
      offset_hits += Dot(point.ng, away.d) > 0 && scene->tracer->Intersect(naive, &hit);
    }
  }
  EXPECT_GE(spawned, 100000);
  ExpectHardCase({.row = "G10",
                  .figure = "part of rays that meet the straight curve they leave",
                  .expected = 0,
                  .measured = self_hits / static_cast<double>(spawned),
                  .naive = offset_hits / static_cast<double>(spawned),
                  .naive_by = "origins of rays to the outside moved by 1e-4 along the normal"});
}

// G10: white hair under a white sky is white, however curled it is.
TEST(CurveStability, G10FurnaceOfHair) {
  for (const Kind kind : kKinds) {
    SCOPED_TRACE(static_cast<int>(kind));
    TestScene t({0, 0, -2.2}, {0, 0, 0}, 50);
    t.AddShape(AddCurves(&t, Tangle(kind, 400, 0.03, 5)), t.Diffuse(Rgb::Gray(1)));
    t.ConstantEnvironment(Rgb::Gray(1));
    FrameSettings settings = SquareSettings(24, 64, 400);
    ExpectMean(RenderMean(t.scene, settings), Rgb::Gray(1));
    // Gray is exact in spectral transport too, except for the sampled sums of the observer.
    settings.color = ColorTransport::kSpectral;
    const TileMean spectral = RenderMean(t.scene, settings);
    EXPECT_EQ(spectral.non_finite, 0u);
    EXPECT_NEAR(spectral.mean.g, 1, 5 * static_cast<double>(spectral.standard_error.g) + 1e-4);
  }
}

// G2: scaling by powers of two changes no bit.
TEST(CurveStability, G2PowersOfTwoChangeNoBit) {
  const auto room = [](double scale) {
    TestScene t = LitRoom(scale);
    const Matrix4 size = ScaleMatrix({scale, scale, scale});
    for (const Kind kind : kKinds) {
      t.AddShape(AddCurves(&t, Tangle(kind, 60, 0.02, 7 + static_cast<uint64_t>(kind))),
                 t.Diffuse({0.6f, 0.4f, 0.2f}),
                 size * TranslateMatrix({-0.2, 0, 0.5}) * RotateMatrix(40, {1, 2, 3}) *
                     ScaleMatrix({0.7, 0.5, -0.6}));
    }
    return RenderAll(*Compile(t.scene, SquareSettings(16, 16, 5)));
  };
  const FilmTile still = room(1);
  EXPECT_GT(MeanOf(still).mean.r, 0);
  for (const int exponent : {-20, -10, 10, 20}) {
    const FilmTile scaled = room(std::ldexp(1.0, exponent));
    for (const FilmChannel c : {FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kBlueHi}) {
      EXPECT_TRUE(
          std::equal(still.channel(c), still.channel(c) + still.plane_size(), scaled.channel(c)))
          << "2^" << exponent;
    }
  }
}

// G1: a million units away from the origin the image is the same within its error.
TEST(CurveStability, G1FarFromTheOrigin) {
  const auto image = [](double distance) {
    const Vec3d away{distance, -distance, 0.5 * distance};
    TestScene t(Vec3d{0, 0, -2.2} + away, away, 50);
    t.AddShape(AddCurves(&t, Tangle(Kind::kCylinder, 200, 0.01, 3)), t.Diffuse(Rgb::Gray(0.7f)),
               TranslateMatrix(away));
    t.ConstantEnvironment(Rgb::Gray(1));
    return RenderMean(t.scene, SquareSettings(24, 64, 5));
  };
  const TileMean near = image(0), far = image(1e6);
  EXPECT_LT(near.mean.g, 0.99f);
  EXPECT_NEAR(near.mean.g, far.mean.g, 5 * std::hypot(near.standard_error.g, far.standard_error.g));
}

// A straight curve covers the correct area: that of a black strip in front of a white sky, and of a
// cylinder of the same thickness.
TEST(CurveStability, StraightCurvesCoverAsCylinders) {
  const auto seen = [](int what, double width) {
    TestScene t({0, 0, -5}, {0, 0, 0}, 60);
    t.scene.camera.kind = CameraDescription::Kind::kOrthographic;
    t.ConstantEnvironment(Rgb::Gray(1));
    const Matrix4 turn = RotateMatrix(30, {0, 0, 1});
    if (what < 2) {
      t.AddShape(AddCurves(&t, StraightCurve(kKinds[what], {-0.5f, 0, 0}, {0.5f, 0, 0},
                                             static_cast<float>(width))),
                 t.Diffuse({}), turn);
    } else {
      CylinderShape cylinder{static_cast<float>(0.5 * width), -0.5f, 0.5f, 360};
      t.AddShape(cylinder, t.Diffuse({}), turn * RotateMatrix(90, {0, 1, 0}));
    }
    return RenderMean(t.scene, SquareSettings(32, 256, 1));
  };
  for (const double width : {0.3, 0.03, 0.003}) {
    SCOPED_TRACE(width);
    const auto clear = static_cast<float>(1 - width * 1 / 4);  // The image is 2 x 2.
    for (int what = 0; what < 3; ++what) {
      const TileMean mean = seen(what, width);
      EXPECT_NEAR(mean.mean.g, clear, 5 * static_cast<double>(mean.standard_error.g) + 1e-6)
          << what;
      EXPECT_LT(mean.standard_error.g, 0.03 * width);
    }
  }
}

// A curve of type cylinder is lit like a cylinder: a light from above lights its upper half. The
// normal turns uniformly with v across the width, so the mean over the upper half is that of cos
// over [0, pi/2], 2/pi.
TEST(CurveStability, CylinderCurvesShadeAsRound) {
  TestScene t({0, 0, -5}, {0, 0, 0}, 60);
  t.scene.camera.kind = CameraDescription::Kind::kOrthographic;
  for (int i = 0; i < 4; ++i) t.scene.camera.screen_window[i] *= 0.5;
  t.AddShape(AddCurves(&t, StraightCurve(Kind::kCylinder, {-9, 0, 0}, {9, 0, 0}, 1)),
             t.Diffuse(Rgb::Gray(1)));
  DistantLight sun;
  sun.radiance.rgb = Rgb::Gray(std::numbers::pi_v<float>);
  sun.from = {0, 1, 0};
  sun.to = {0, 0, 0};
  t.scene.lights.push_back({sun, {}, {}, {}});
  const FilmTile tile = RenderAll(*Compile(t.scene, SquareSettings(16, 256, 1)));
  double upper = 0, lower = 0;
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) {
      (y < 8 ? upper : lower) +=
          static_cast<double>(tile.channel(FilmChannel::kGreenHi)[y * 16 + x]);
    }
  }
  EXPECT_NEAR(upper / (128 * 256), 2 / std::numbers::pi, 0.002);
  EXPECT_EQ(lower, 0);
}

// G7: a curve in the world, mirrored, in an object definition and moving has the same shape.
TEST(CurveStability, G7PlacedCurvesAreTheSame) {
  for (const Kind kind : kKinds) {
    for (const bool mirrors : {false, true}) {
      const Matrix4 place = TranslateMatrix({0.3, 0.2, 4}) * RotateMatrix(20, {1, 2, 3}) *
                            ScaleMatrix({mirrors ? -1.5 : 1.5, 1, 0.5});
      const CurveSet set = Tangle(kind, 50, 0.1, 11);
      TestScene world = AtOrigin(), object = AtOrigin(), moving = AtOrigin();
      world.AddShape(AddCurves(&world, set), kNone, place);
      object.AddLooseShape(AddCurves(&object, set), kNone);
      object.scene.objects.push_back({"locks", {0}, {}});
      TransformOverTime still;
      still.start = still.end = place;
      object.scene.instances.push_back({0, still, {}});
      moving.scene.camera.shutter_close = 1;
      moving.AddShape(AddCurves(&moving, set), kNone, place).world_from_object.end =
          TranslateMatrix({2, 0, 0}) * place;
      const std::unique_ptr<TracedScene> a = Traced(world.scene), b = Traced(object.scene),
                                         c = Traced(moving.scene);
      Random random(12);
      const auto segment_of = [](const TracedScene& scene, const SurfacePoint& point) {
        const uint32_t group = point.id.placed == kNotPlaced ? 0 : 1;
        return scene.geometry.groups[group].curves[0].pieces[point.id.primitive].segment;
      };
      int hits = 0, differing = 0;
      for (int i = 0; i < 4000; ++i) {
        const Vec3f from = random.Direction();
        const Vec3f to = ToFloat(TransformPoint(place, ToDouble(random.Direction()) * 0.6));
        SurfacePoint p[3];
        const bool hit = HitTowards(*a, from, to, &p[0]);
        // A rounded ray may pass on the other side of the silhouette.
        if (hit != HitTowards(*b, from, to, &p[1]) || hit != HitTowards(*c, from, to, &p[2])) {
          ++differing;
          continue;
        }
        if (!hit) continue;
        ++hits;
        // Curves that face every ray are hit on their front.
        EXPECT_TRUE(kind == Kind::kRibbon || Dot(from - to, p[0].ng) > -1e-5f);
        EXPECT_NEAR(Dot(p[0].shading.n, p[0].ng), 1, 1e-5);
        for (int k = 1; k < 3; ++k) {
          // Pieces are split by their size in the world, so compare the segments. Where one bends
          // within its width, either nearest point may result.
          if (segment_of(*(k == 1 ? b : c), p[k]) != segment_of(*a, p[0]) ||
              std::fabs(p[k].uv.x - p[0].uv.x) > 1e-4f) {
            ++differing;
            continue;
          }
          const float close = 1e-4f;
          EXPECT_LT(Length(p[k].p - p[0].p), close);
          EXPECT_GT(std::fabs(Dot(p[k].ng, p[0].ng)), 1 - close);
          EXPECT_GT(Dot(p[k].shading.t, p[0].shading.t), 1 - close);
          EXPECT_NEAR(p[k].uv.y, p[0].uv.y, 0.01f);
        }
      }
      EXPECT_GT(hits, 800);
      EXPECT_LT(differing, hits / 100);
    }
  }
}

// In the middle of the shutter interval the curve is halfway.
TEST(CurveStability, G13CurvesMove) {
  TestScene t = AtOrigin();
  t.scene.camera.shutter_close = 1;
  t.AddShape(AddCurves(&t, StraightCurve(Kind::kFlat, {0, -1, 5}, {0, 1, 5}, 0.01f)), kNone)
      .world_from_object.end = TranslateMatrix({2, 0, 0});
  const std::unique_ptr<TracedScene> scene = Traced(t.scene);
  for (const float time : {0.0f, 0.25f, 0.5f, 1.0f}) {
    Ray ray;
    ray.d = {2 * time, 0, 5};
    ray.time = time;
    RawHit hit;
    EXPECT_TRUE(scene->tracer->Intersect(ray, &hit)) << time;
    EXPECT_NEAR(hit.t, 1, 1e-6f);
    ray.d.x += 0.1f;
    EXPECT_FALSE(scene->tracer->Intersect(ray, &hit)) << time;
  }
}

// The plan has a trait for curves; without it none of their code runs.
TEST(CurveStability, CurvesHaveATrait) {
  TestScene with = LitRoom(1);
  with.AddShape(AddCurves(&with, Tangle(Kind::kFlat, 3, 0.01, 1)), 0).location = {0, 5, 1};
  const FrameSettings settings = SquareSettings(4, 1, 1);
  const std::string plan = FormatRenderPlan(MakeRenderPlan(with.scene, settings));
  EXPECT_NE(plan.find("test.pbrt:5:1: Shape \"curve\""), std::string::npos) << plan;
  const RenderPlan without = MakeRenderPlan(LitRoom(1).scene, settings);
  EXPECT_FALSE(Has(without.traits, Trait::kCurves));
  EXPECT_FALSE(Has(without.variant_traits, Trait::kCurves));
}

TEST(CurveStability, EmissiveCurvesAreRefused) {
  TestScene t = LitRoom(1);
  ShapeDescription& shape = t.AddShape(AddCurves(&t, Tangle(Kind::kFlat, 3, 0.01, 1)), 0);
  shape.area_light = 0;
  shape.location = {0, 7, 1};
  TableFileSource files({});
  const auto compiled = CompileScene(t.scene, SquareSettings(4, 1, 1), files);
  ASSERT_FALSE(compiled.ok());
  EXPECT_EQ(std::string(compiled.status().message()).find("test.pbrt:7:1: Shape \"curve\": "), 0u)
      << compiled.status();
}

}  // namespace
}  // namespace sheaf::render
