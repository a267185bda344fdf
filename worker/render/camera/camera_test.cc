// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/camera/camera.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "tests/support/test_scene.h"
#include "worker/render/traits/variant_list.h"

namespace sheaf::render {
namespace {

constexpr double kPi = std::numbers::pi;
using Kind = CameraDescription::Kind;

SceneDescription SceneWith(Kind kind) {
  SceneDescription scene;
  scene.files = {"room.pbrt"};
  scene.camera.kind = kind;
  scene.camera.location = {0, 2, 1};
  return scene;
}
Camera MakeCamera(const SceneDescription& scene, int32_t width_px, int32_t height_px,
                  Vec3d render_origin_world = {}) {
  const auto camera = Camera::Make(scene, width_px, height_px, render_origin_world);
  EXPECT_TRUE(camera.ok()) << camera.status();
  return camera.ok() ? *camera : Camera{};
}
void ExpectNear(Vec3f a, Vec3d b, double allowed) {
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], allowed) << i;
}

TEST(CameraTest, FilmPointsInvertRays) {
  for (const Kind kind : {Kind::kPerspective, Kind::kOrthographic}) {
    SceneDescription scene = SceneWith(kind);
    ASSERT_TRUE(
        LookAtMatrix({1, 2, 3}, {4, -1, 7}, {0, 1, 0}, &scene.camera.world_from_camera.start));
    scene.camera.world_from_camera.end =
        TranslateMatrix({0.5, 0, 0}) * scene.camera.world_from_camera.start;
    const Camera camera = MakeCamera(scene, 200, 100, {1, 2, 3});
    for (const Vec2d film : {Vec2d{0, 0}, Vec2d{100, 50}, Vec2d{33.25, 80.5}}) {
      for (const float time : {0.0f, 0.25f, 1.0f}) {
        const Ray ray = camera.MakeRay<kAllTraits>(film, {}, time);
        const auto seen = camera.FilmPointOf(ToDouble(ray.o) + ToDouble(ray.d) * 5.0, time);
        ASSERT_TRUE(seen.has_value());
        EXPECT_NEAR(seen->x, film.x, 1e-3);
        EXPECT_NEAR(seen->y, film.y, 1e-3);
      }
    }
  }
  const Camera camera = MakeCamera(SceneWith(Kind::kPerspective), 200, 100);
  EXPECT_FALSE(camera.FilmPointOf({0, 0, -1}, 0).has_value());
}

TEST(CameraTest, ClipPlanesAreAtOneDepth) {
  for (const Kind kind : {Kind::kPerspective, Kind::kOrthographic, Kind::kEquirectangular}) {
    SceneDescription scene = SceneWith(kind);
    scene.camera.near_clip = 0.5f;
    scene.camera.far_clip = 20;
    if (kind == Kind::kPerspective) {
      scene.camera.lens_radius = 0.25f;
      scene.camera.focal_distance = 3;
    }
    ASSERT_TRUE(
        LookAtMatrix({1, 2, 3}, {4, -1, 7}, {0, 1, 0}, &scene.camera.world_from_camera.start));
    scene.camera.world_from_camera.end =
        TranslateMatrix({0.5, 0, 0}) * scene.camera.world_from_camera.start;
    const Camera camera = MakeCamera(scene, 200, 100, {1, 2, 3});
    ASSERT_TRUE(camera.HasNearClip() && camera.HasFarClip());
    for (const Vec2d film : {Vec2d{0, 0}, Vec2d{100, 50}, Vec2d{33.25, 80.5}}) {
      for (const float time : {0.0f, 0.5f}) {
        Ray ray = camera.MakeRay<kAllTraits>(film, {0.9f, 0.1f}, time);
        const auto depth_at = [&](double t) {
          const Vec3d q =
              camera.CameraFromRenderAt(time).Point(ToDouble(ray.o) + ToDouble(ray.d) * t);
          return kind == Kind::kEquirectangular ? Length(q) : q.z;
        };
        EXPECT_NEAR(depth_at(camera.NearClip(ray)), 0.5, 1e-6);
        EXPECT_NEAR(depth_at(camera.FarClip(ray)), 20, 1e-5);
        // A ray that has passed a surface, its direction of another length.
        ray.o = ray.o + ray.d * 2;
        ray.d = ray.d * 3;
        EXPECT_NEAR(depth_at(camera.FarClip(ray)), 20, 1e-5);
      }
    }
  }
  const Camera open = MakeCamera(SceneWith(Kind::kPerspective), 200, 100);
  EXPECT_FALSE(open.HasNearClip() || open.HasFarClip());
}

TEST(CameraTest, PerspectiveSpansItsFieldOfView) {
  for (const float fov_degrees : {0.01f, 40.0f, 90.0f, 170.0f}) {
    SCOPED_TRACE(fov_degrees);
    SceneDescription scene = SceneWith(Kind::kPerspective);
    scene.camera.fov_degrees = fov_degrees;
    scene.camera.screen_window[0] = -2;  // Twice as wide as high: fov is that of the height.
    scene.camera.screen_window[1] = 2;
    const Camera camera = MakeCamera(scene, 200, 100);
    const double half = std::tan(static_cast<double>(fov_degrees) * kPi / 360);
    const auto expect = [&](Vec2d film, double x, double y) {
      const Ray ray = camera.MakeRay<kDiffuseTraits>(film, {}, 0);
      ExpectNear(ray.o, {0, 0, 0}, 0);
      ExpectNear(ray.d, Normalize(Vec3d{x * half, y * half, 1}), 1e-7);
    };
    expect({100, 50}, 0, 0);
    expect({100, 0}, 0, 1);  // Rows count downwards.
    expect({100, 100}, 0, -1);
    expect({0, 50}, -2, 0);
    expect({200, 100}, 2, -1);
    expect({130.25, 12.5}, 0.605, 0.75);
  }
}

TEST(CameraTest, ScreenWindowsMayBeOffCenter) {
  SceneDescription scene = SceneWith(Kind::kPerspective);
  const double window[4] = {0.25, 0.75, -1, -0.5};
  for (int i = 0; i < 4; ++i) scene.camera.screen_window[i] = window[i];
  const Camera camera = MakeCamera(scene, 64, 64);
  ExpectNear(camera.MakeRay<kDiffuseTraits>({0, 0}, {}, 0).d, Normalize(Vec3d{0.25, -0.5, 1}),
             1e-7);
  ExpectNear(camera.MakeRay<kDiffuseTraits>({64, 64}, {}, 0).d, Normalize(Vec3d{0.75, -1, 1}),
             1e-7);
}

TEST(CameraTest, OrthographicRaysAreParallel) {
  SceneDescription scene = SceneWith(Kind::kOrthographic);
  for (double& side : scene.camera.screen_window) side *= 3;
  const Camera camera = MakeCamera(scene, 60, 60);
  for (const Vec2d film : {Vec2d{0, 0}, Vec2d{30, 45}, Vec2d{60, 10}}) {
    const Ray ray = camera.MakeRay<kDiffuseTraits>(film, {}, 0);
    ExpectNear(ray.d, {0, 0, 1}, 0);
    ExpectNear(ray.o, {-3 + film.x / 10, 3 - film.y / 10, 0}, 1e-6);
  }
}

// Rays of a film point start all over the lens and meet where the pinhole's ray crosses the focal
// plane.
TEST(CameraTest, LensRaysConvergeInTheFocalPlane) {
  for (const Kind kind : {Kind::kPerspective, Kind::kOrthographic}) {
    SceneDescription scene = SceneWith(kind);
    const Camera pinhole = MakeCamera(scene, 100, 100);
    scene.camera.lens_radius = 0.5f;
    scene.camera.focal_distance = 4;
    const Camera camera = MakeCamera(scene, 100, 100);
    const Vec2d film{80, 35};
    const Ray central = pinhole.MakeRay<kAllTraits>(film, {}, 0);
    const Vec3d focus =
        ToDouble(central.o) + ToDouble(central.d) * (4 / static_cast<double>(central.d.z));
    double radius_square_sum = 0;
    constexpr int kSide = 64;
    for (int i = 0; i < kSide * kSide; ++i) {
      const Vec2f lens{static_cast<float>((i % kSide + 0.5) / kSide),
                       static_cast<float>((i / kSide + 0.5) / kSide)};
      const Ray ray = camera.MakeRay<kAllTraits>(film, lens, 0);
      const Vec3d at = ToDouble(ray.o) + ToDouble(ray.d) * (4 / static_cast<double>(ray.d.z));
      EXPECT_NEAR(Length(at - focus), 0, 2e-6);
      const double off_axis = Length(ToDouble(ray.o) - ToDouble(central.o));
      EXPECT_LE(off_axis, 0.5 + 1e-6);
      radius_square_sum += off_axis * off_axis;
    }
    // Uniform in area: the mean of r^2 is half the radius squared.
    EXPECT_NEAR(radius_square_sum / (kSide * kSide), 0.125, 1e-4);
  }
}

// Render space is centered at the camera, so a distant camera keeps its precision.
TEST(CameraTest, RenderSpaceStartsAtTheCamera) {
  SceneDescription scene = SceneWith(Kind::kPerspective);
  const Vec3d place{1e7 + 0.125, -3e6, 5e8};
  scene.camera.world_from_camera.start = scene.camera.world_from_camera.end =
      TranslateMatrix(place) * RotateMatrix(90, {0, 1, 0});
  const Camera camera = MakeCamera(scene, 100, 100, place);
  const Ray ray = camera.MakeRay<kDiffuseTraits>({50, 50}, {}, 0);
  ExpectNear(ray.o, {0, 0, 0}, 1e-6);
  ExpectNear(ray.d, {1, 0, 0}, 1e-7);
}

// A moving camera follows a straight line over time.
TEST(CameraTest, MovesOverTheShutter) {
  SceneDescription scene = SceneWith(Kind::kPerspective);
  scene.camera.world_from_camera.end = TranslateMatrix({2, 0, -4});
  const Camera camera = MakeCamera(scene, 100, 100);
  for (const float time : {0.0f, 0.25f, 1.0f}) {
    const Ray ray = camera.MakeRay<kAllTraits>({50, 50}, {}, time);
    EXPECT_EQ(ray.time, time);
    ExpectNear(ray.o, Vec3d{2, 0, -4} * static_cast<double>(time), 1e-6);
  }
}

// As in pbrt-v4: +y is up, and a row of the image starts at +x and continues by +z.
TEST(CameraTest, EquirectangularPixelsAreLongitudeAndLatitude) {
  const Camera camera = MakeCamera(SceneWith(Kind::kEquirectangular), 400, 200);
  const auto expect = [&](Vec2d film, Vec3d direction) {
    const Ray ray = camera.MakeRay<kDiffuseTraits>(film, {}, 0);
    ExpectNear(ray.o, {0, 0, 0}, 0);
    ExpectNear(ray.d, direction, 1e-7);
  };
  expect({0, 100}, {1, 0, 0});
  expect({100, 100}, {0, 0, 1});
  expect({200, 100}, {-1, 0, 0});
  expect({300, 100}, {0, 0, -1});
  expect({123, 0}, {0, 1, 0});
  expect({321, 200}, {0, -1, 0});
  expect({50, 50}, {0.5, std::sqrt(0.5), 0.5});
  // A filter that extends over a border sees the continuation of the image.
  const auto expect_same = [&](Vec2d outside, Vec2d inside) {
    ExpectNear(camera.MakeRay<kDiffuseTraits>(outside, {}, 0).d,
               ToDouble(camera.MakeRay<kDiffuseTraits>(inside, {}, 0).d), 1.5e-7);
  };
  expect_same({-1.25, 70}, {398.75, 70});
  expect_same({401.5, 70}, {1.5, 70});
  expect_same({30, -0.75}, {230, 0.75});  // Over the pole.
  expect_same({250, 201.5}, {50, 198.5});
}

TEST(CameraTest, EqualAreaPixelsFoldAroundTheSquare) {
  const Camera camera = MakeCamera(SceneWith(Kind::kEqualArea), 64, 64);
  const auto direction = [&](double x, double y) {
    return camera.MakeRay<kDiffuseTraits>({x, y}, {}, 0).d;
  };
  ExpectNear(direction(32, 32), {0, 1, 0}, 1e-7);  // The center is up, the corners are down.
  for (const double x : {0.0, 64.0}) {
    for (const double y : {0.0, 64.0}) ExpectNear(direction(x, y), {0, -1, 0}, 1e-7);
  }
  ExpectNear(direction(64, 32), {1, 0, 0}, 1e-7);  // Middles of edges are on the horizon.
  ExpectNear(direction(0, 32), {-1, 0, 0}, 1e-7);
  ExpectNear(direction(32, 64), {0, 0, 1}, 1e-7);
  ExpectNear(direction(32, 0), {0, 0, -1}, 1e-7);
  // Beyond an edge the image continues with the other half of that edge, rotated; also far beyond,
  // which a wide filter on a small image reaches.
  for (const Vec2d in : {Vec2d{1.5, 20}, Vec2d{60, 3}, Vec2d{31, 50}}) {
    for (const Vec2d out :
         {Vec2d{-in.x, 64 - in.y}, Vec2d{128 - in.x, 64 - in.y}, Vec2d{64 - in.x, -in.y},
          Vec2d{64 - in.x, 128 - in.y}, Vec2d{in.x + 64, in.y + 64}, Vec2d{in.x - 128, in.y}}) {
      ExpectNear(direction(out.x, out.y), ToDouble(direction(in.x, in.y)), 1.5e-7);
    }
  }
}

// Pixel weights of the two mappings: constant, or the solid angle of the row's zone. With these
// weights the mean of max(cos, 0) about any axis is 1/4, that of 1 is 1.
TEST(CameraTest, SphericalPixelsAreWeightedBySolidAngle) {
  constexpr int kWidth = 256, kHeight = 128;
  for (const Kind kind : {Kind::kEquirectangular, Kind::kEqualArea}) {
    const Camera camera = MakeCamera(SceneWith(kind), kWidth, kHeight);
    for (const Vec3d axis : {Vec3d{0, 1, 0}, Vec3d{0.6, 0, -0.8}, Vec3d{0.48, -0.6, 0.64}}) {
      double sum = 0, weight_sum = 0;
      for (int y = 0; y < kHeight; ++y) {
        const double zone = std::cos(kPi * y / kHeight) - std::cos(kPi * (y + 1) / kHeight);
        const double weight = kind == Kind::kEqualArea ? 1.0 / kHeight : zone / 2;
        for (int x = 0; x < kWidth; ++x) {
          const Ray ray = camera.MakeRay<kDiffuseTraits>({x + 0.5, y + 0.5}, {}, 0);
          EXPECT_NEAR(Length(ToDouble(ray.d)), 1, 1e-7);
          sum += std::max(Dot(ToDouble(ray.d), axis), 0.0) * weight / kWidth;
          weight_sum += weight / kWidth;
        }
      }
      EXPECT_NEAR(weight_sum, 1, 1e-12);
      EXPECT_NEAR(sum, 0.25, 5e-5);
    }
  }
}

// With every filter, also at the borders, the image of a constant sky is constant, whatever the
// camera's position and motion.
TEST(CameraTest, SphericalCamerasSeeAConstantSky) {
  for (const Kind kind : {Kind::kEquirectangular, Kind::kEqualArea}) {
    TestScene t({1e6, 3, -2e5}, {1e6, 3, 1}, 90);
    t.ConstantEnvironment({0.25f, 2, 5});
    t.scene.camera.kind = kind;
    t.scene.camera.world_from_camera.end = TranslateMatrix({1e6, 4, -2e5});
    t.scene.camera.shutter_close = 1;
    t.scene.filter.kind = FilterDescription::Kind::kGaussian;
    t.scene.filter.radius_x_px = t.scene.filter.radius_y_px = 9;  // Wider than the image.
    ExpectMean(RenderMean(t.scene, SquareSettings(8, 16, 2)), {0.25f, 2, 5});
  }
}

TEST(CameraTest, ErrorsNameCameraAndReason) {
  SceneDescription flat = SceneWith(Kind::kPerspective), wide = flat, empty = flat,
                   unfocused = flat, lensed = SceneWith(Kind::kEqualArea);
  flat.camera.fov_degrees = 0;
  wide.camera.fov_degrees = 180;
  empty.camera.screen_window[1] = empty.camera.screen_window[0];
  unfocused.camera.lens_radius = 1;
  unfocused.camera.focal_distance = -1;
  lensed.camera.lens_radius = 1;
  for (const SceneDescription& scene : {flat, wide, empty, unfocused, lensed}) {
    const auto camera = Camera::Make(scene, 10, 10, {});
    ASSERT_FALSE(camera.ok());
    EXPECT_EQ(camera.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_NE(std::string(camera.status().message()).find("room.pbrt:2:1"), std::string::npos);
  }
}

}  // namespace
}  // namespace sheaf::render
