// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of motion (G13, G14) and of the camera (C1), named as in the catalogue.
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <vector>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "tests/support/hard_case.h"
#include "tests/support/naive_geometry.h"
#include "tests/support/test_scene.h"
#include "worker/render/camera/camera.h"
#include "worker/render/geometry/animated_transform.h"
#include "worker/render/scene/scene_baker.h"

namespace sheaf::render {
namespace {

// G13: a shutter interval of length 0 shows the still scene; a moving edge gives the ramp that
// follows from its speed.
TEST(MotionStability, G13ClosedShutterMatchesTheStaticScene) {
  const FrameSettings settings = SquareSettings(12, 16, 3);
  TestScene moving = LitRoom(1);
  moving.scene.shapes[1].world_from_object.end =
      TranslateMatrix({0.2, 0, 0}) * moving.scene.shapes[1].world_from_object.start;
  const FilmTile closed = RenderAll(*Compile(moving.scene, settings));
  const FilmTile still = RenderAll(*Compile(LitRoom(1).scene, settings));
  EXPECT_TRUE(closed == still);
  const float expected = MeanOf(still).mean.g;
  ExpectHardCase({.row = "G13",
                  .figure = "mean radiance through a shutter that closes as it opens",
                  .expected = expected,
                  .measured = MeanOf(closed).mean.g,
                  .naive = expected * (1 + naive::TimeInShutter(0, 0, 0)),
                  .naive_by = "time as (t - open) / (close - open)"});
}

TEST(MotionStability, G13MovingEdgeIsALinearRamp) {
  // Orthographic, 16 pixels over [-1, 1]: the quad's right edge goes from x = -0.5 to x = 0.5.
  TestScene t({0, 0, -5}, {0, 0, 0}, 60);
  t.scene.camera.kind = CameraDescription::Kind::kOrthographic;
  t.scene.camera.shutter_close = 1;
  ShapeDescription& quad =
      t.AddShape(MeshShape{t.Quad({-10, -10, 0}, {-0.5f, -10, 0}, {-0.5f, 10, 0}, {-10, 10, 0})},
                 t.Diffuse(Rgb::Gray(0.5f)));
  quad.world_from_object.end = TranslateMatrix({1, 0, 0});
  const FrameSettings settings = SquareSettings(16, 256, 0);
  const FilmTile tile = RenderAll(*Compile(t.scene, settings));
  for (int px = 0; px < 16; ++px) {
    double covered = 0;
    for (int py = 0; py < 16; ++py) covered += tile.channel(FilmChannel::kAlpha)[py * 16 + px];
    covered /= 16 * 256;
    const double x = -1 + (px + 0.5) / 8;
    const double expected = std::clamp(0.5 - x, 0.0, 1.0);
    // 4096 stratified samples per column: the error of unstratified ones would be 0.008.
    EXPECT_NEAR(covered, expected, 0.02) << px;
  }
}

// G14: rotation preserves radii for every arc.
TEST(MotionStability, G14RotationKeepsRadii) {
  for (const double degrees : {1e-9, 1e-3, 1.0, 90.0, 179.0, 180.0}) {
    SCOPED_TRACE(degrees);
    TransformOverTime motion;
    motion.start = RotateMatrix(33, {1, 2, 3});
    motion.end = RotateMatrix(degrees, {0.3, -1, 0.5}) * motion.start;
    const absl::StatusOr<AnimatedTransform> transform = AnimatedTransform::Make(motion);
    ASSERT_TRUE(transform.ok());
    double length = 1;
    for (int i = 0; i <= 10; ++i) {
      const double at = Length(transform->At(0.1 * i).Point({0.6, 0.0, 0.8}));
      if (!(std::fabs(at - 1) <= std::fabs(length - 1))) length = at;
    }
    const Vec3f first = ToFloat(transform->At(0).Point({0.6, 0.0, 0.8})),
                last = ToFloat(transform->At(1).Point({0.6, 0.0, 0.8}));
    ExpectHardCase(
        {.row = "G14",
         .figure = "radius that is furthest off in a turn by " + InWords(degrees) + " degrees",
         .expected = 1,
         .measured = length,
         .tolerance = 1e-12,
         .naive = Length((first + last) * 0.5f),
         .naive_by = "half way by the mean of both matrices"});
    // Constant speed: half the time is half the arc.
    const Affine half = transform->At(0.5);
    const Affine expected = AffineOf(RotateMatrix(degrees / 2, {0.3, -1, 0.5}) * motion.start);
    if (degrees < 180) {
      EXPECT_NEAR(Length(half.Point({1, 1, 1}) - expected.Point({1, 1, 1})), 0, 1e-10);
    }
  }
}

TEST(MotionStability, G14StretchAndMirrorInterpolateStably) {
  TransformOverTime motion;
  motion.start = ScaleMatrix({-2, 1, 3});
  motion.end = TranslateMatrix({1, 0, 0}) * RotateMatrix(60, {0, 0, 1}) * ScaleMatrix({-4, 1, 3});
  const absl::StatusOr<AnimatedTransform> transform = AnimatedTransform::Make(motion);
  ASSERT_TRUE(transform.ok());
  const Affine half = transform->At(0.5);
  EXPECT_NEAR(half.Determinant(), -9, 1e-9);
  motion.end = ScaleMatrix({2, 1, 3});
  EXPECT_FALSE(AnimatedTransform::Make(motion).ok());
}

// G14: bounds interpolated linearly between steps contain the rotating group at all times.
TEST(MotionStability, G14RotatingGroupsStayInTheirBounds) {
  TestScene t({0, 0, -5}, {0, 0, 0}, 60);
  t.scene.camera.shutter_close = 1;
  ShapeDescription& box = t.AddShape(MeshShape{t.Box({1, -0.1f, -0.1f}, {3, 0.1f, 0.1f})}, kNone);
  box.world_from_object.end = RotateMatrix(170, {0, 0, 1});
  SceneDescription scene = t.scene;
  const std::vector<Vec3f> corners = scene.meshes[0].positions;
  absl::StatusOr<BakedScene> baked = BakeScene(&scene);
  ASSERT_TRUE(baked.ok());
  const SceneGeometry& geometry = baked->geometry;
  ASSERT_EQ(geometry.moving.size(), 1u);
  for (int i = 0; i < 1600; ++i) {
    const double at = i / 100.0;
    const auto step = static_cast<uint32_t>(at);
    const PlacedBounds a = BoundsOfMoving(geometry, geometry.moving[0], step);
    const PlacedBounds b = BoundsOfMoving(geometry, geometry.moving[0], step + 1);
    const auto f = static_cast<float>(at - step);
    const Affine transform = RenderFromGroupAt(geometry, geometry.moving[0],
                                               static_cast<float>(at / (kMotionStepCount - 1)));
    for (const Vec3f& corner : corners) {
      const Vec3d p = transform.Point(ToDouble(corner) - geometry.motions[0].group_center);
      for (size_t axis = 0; axis < 3; ++axis) {
        EXPECT_GE(p[axis], a.lower[axis] * (1 - f) + b.lower[axis] * f - 1e-6);
        EXPECT_LE(p[axis], a.upper[axis] * (1 - f) + b.upper[axis] * f + 1e-6);
      }
    }
  }
}

// C1: all rays of a film point meet in the plane of focus; a point at depth S is spread over a
// circle of radius R |1/S - 1/F| on the screen one unit away (the circle of confusion, A |S - F| /
// S / F for an aperture A in that unit).
// A shape that turns within an object whose instance turns and grows: two motions in a row.
TEST(MotionStability, G14ShapesThatMoveInMovingObjectsStayInTheirBounds) {
  TestScene t({0, 0, -5}, {0, 0, 0}, 60);
  t.scene.camera.shutter_close = 1;
  ShapeDescription& box = t.AddShape(MeshShape{t.Box({1, -0.1f, -0.1f}, {3, 0.1f, 0.1f})}, kNone);
  box.world_from_object.end = RotateMatrix(120, {0, 0, 1}) * TranslateMatrix({0.5, 0, 0});
  const TransformOverTime inner = box.world_from_object;
  t.scene.objects.push_back({"arm", t.scene.world_shapes, {}});
  t.scene.world_shapes.clear();
  ObjectInstance instance;
  instance.object = 0;
  instance.world_from_instance.end =
      TranslateMatrix({0, 1, 2}) * RotateMatrix(100, {0, 1, 0}) * ScaleMatrix({1, 2, 1.5});
  const TransformOverTime outer = instance.world_from_instance;
  t.scene.instances.push_back(instance);
  SceneDescription scene = t.scene;
  const std::vector<Vec3f> corners = scene.meshes[0].positions;
  absl::StatusOr<BakedScene> baked = BakeScene(&scene);
  ASSERT_TRUE(baked.ok()) << baked.status();
  const SceneGeometry& geometry = baked->geometry;
  ASSERT_EQ(geometry.moving.size(), 1u);
  const AnimatedTransform world = *AnimatedTransform::Make(outer),
                          object = *AnimatedTransform::Make(inner);
  for (int i = 0; i < 1600; ++i) {
    const double at = i / 100.0;
    const auto step = static_cast<uint32_t>(at);
    const PlacedBounds a = BoundsOfMoving(geometry, geometry.moving[0], step);
    const PlacedBounds b = BoundsOfMoving(geometry, geometry.moving[0], step + 1);
    const double f = at - step, time = at / (kMotionStepCount - 1);
    const Affine transform =
        RenderFromGroupAt(geometry, geometry.moving[0], static_cast<float>(time));
    for (const Vec3f& corner : corners) {
      const Vec3d p = transform.Point(ToDouble(corner) - geometry.motions[0].group_center);
      const Vec3d expected = world.At(time).Point(object.At(time).Point(ToDouble(corner))) -
                             geometry.render_origin_world;
      for (size_t axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(p[axis], expected[axis], 1e-5);
        EXPECT_GE(p[axis], a.lower[axis] * (1 - f) + b.lower[axis] * f - 1e-6);
        EXPECT_LE(p[axis], a.upper[axis] * (1 - f) + b.upper[axis] * f + 1e-6);
      }
    }
  }
}

TEST(CameraStability, C1CircleOfConfusion) {
  TestScene t({0, 0, 0}, {0, 0, 1}, 90);
  t.scene.camera.lens_radius = 0.25f;
  for (const double focus : {1e-3, 2.0, 1e6, HUGE_VAL}) {
    t.scene.camera.focal_distance = static_cast<float>(focus);
    const absl::StatusOr<Camera> camera = Camera::Make(t.scene, 100, 100, {0, 0, 0});
    ASSERT_TRUE(camera.ok());
    Random random(7);
    double off = 0;
    for (int i = 0; i < 100; ++i) {
      const Vec2f u{static_cast<float>(random.Uniform()), static_cast<float>(random.Uniform())};
      const Vec2d lens = SampleUnitDisk(u) * 0.25;
      constexpr double kDepth = 3;
      const double fraction = 1 / static_cast<double>(t.scene.camera.focal_distance) - 1 / kDepth;
      const Vec2d screen = lens * fraction;
      const Vec2d film{50 + screen.x * 50, 50 - screen.y * 50};
      const Ray ray = camera->MakeRay<kAllTraits>(film, u, 0);
      const double along = kDepth / static_cast<double>(ray.d.z);
      const double spread = 4e-7 * (1 + std::fabs(fraction));
      off = std::max(
          off, std::fabs(static_cast<double>(ray.o.x) + along * static_cast<double>(ray.d.x)));
      EXPECT_NEAR(static_cast<double>(ray.o.x) + along * static_cast<double>(ray.d.x), 0,
                  kDepth * spread);
      EXPECT_NEAR(static_cast<double>(ray.o.y) + along * static_cast<double>(ray.d.y), 0,
                  kDepth * spread);
    }
    if (!std::isinf(focus)) continue;
    ExpectHardCase({.row = "C1",
                    .figure = "how far rays of one point miss it, in focus at infinity",
                    .expected = 0,
                    .measured = off,
                    .tolerance = 2e-6,
                    .naive = naive::FocusX({0, 0, 1}, t.scene.camera.focal_distance),
                    .naive_by = "the point in focus, straight ahead: its x"});
  }
}

TEST(CameraStability, C1FocusAtTheLensIsAnErrorAndNoApertureIsAPinhole) {
  TestScene t({0, 0, 0}, {0, 0, 1}, 90);
  t.scene.camera.lens_radius = 0.25f;
  t.scene.camera.focal_distance = 0;
  EXPECT_FALSE(Camera::Make(t.scene, 100, 100, {0, 0, 0}).ok());
  t.scene.camera.lens_radius = 0;
  const absl::StatusOr<Camera> camera = Camera::Make(t.scene, 100, 100, {0, 0, 0});
  ASSERT_TRUE(camera.ok());
  const Ray ray = camera->MakeRay<kAllTraits>({50, 50}, {0.9f, 0.1f}, 0);
  EXPECT_EQ(ray.o, (Vec3f{0, 0, 0}));
  EXPECT_EQ(ray.d, (Vec3f{0, 0, 1}));
}

}  // namespace
}  // namespace sheaf::render
