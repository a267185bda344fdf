// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/camera.h"

#include <cmath>
#include <numbers>
#include <string>

#include "common/math/transform.h"
#include "gtest/gtest.h"
#include "worker/render/variant_list.h"

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

TEST(CameraTest, PerspectiveSpansItsFieldOfView) {
  for (const float fov_degrees : {0.01f, 40.0f, 90.0f, 170.0f}) {
    SCOPED_TRACE(fov_degrees);
    SceneDescription scene = SceneWith(Kind::kPerspective);
    scene.camera.fov_degrees = fov_degrees;
    scene.camera.screen_window[0] = -2;  // Twice as wide as high: fov is of the height.
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

TEST(CameraTest, ScreenWindowsMayLieAside) {
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

// Rays of a film point start all over the lens and meet where the pinhole's ray crosses the plane
// of focus.
TEST(CameraTest, LensRaysMeetInThePlaneOfFocus) {
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

// Render space has the world's axes and begins at the camera: a far camera keeps its digits.
TEST(CameraTest, RenderSpaceBeginsAtTheCamera) {
  SceneDescription scene = SceneWith(Kind::kPerspective);
  const Vec3d place{1e7 + 0.125, -3e6, 5e8};
  scene.camera.world_from_camera.start = scene.camera.world_from_camera.end =
      TranslateMatrix(place) * RotateMatrix(90, {0, 1, 0});
  const Camera camera = MakeCamera(scene, 100, 100, place);
  const Ray ray = camera.MakeRay<kDiffuseTraits>({50, 50}, {}, 0);
  ExpectNear(ray.o, {0, 0, 0}, 1e-6);
  ExpectNear(ray.d, {1, 0, 0}, 1e-7);
}

// A camera that moves is at each time where a straight line says.
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

TEST(CameraTest, ErrorsNameTheCameraAndWhatIsWrong) {
  SceneDescription flat = SceneWith(Kind::kPerspective), wide = flat, empty = flat,
                   unfocused = flat;
  flat.camera.fov_degrees = 0;
  wide.camera.fov_degrees = 180;
  empty.camera.screen_window[1] = empty.camera.screen_window[0];
  unfocused.camera.lens_radius = 1;
  unfocused.camera.focal_distance = -1;
  for (const SceneDescription& scene : {flat, wide, empty, unfocused}) {
    const auto camera = Camera::Make(scene, 10, 10, {});
    ASSERT_FALSE(camera.ok());
    EXPECT_EQ(camera.status().code(), absl::StatusCode::kInvalidArgument);
    EXPECT_NE(std::string(camera.status().message()).find("room.pbrt:2:1"), std::string::npos);
  }
}

}  // namespace
}  // namespace sheaf::render
