// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Hard cases of smoke that moves while the shutter is open, named as in the catalogue (G2, V5,
// V13): very slow and very fast, scaled by millions, rotated. The tolerance of means is 5 standard
// errors of the difference.
#include <cmath>
#include <utility>

#include "gtest/gtest.h"
#include "tests/support/long_tests.h"
#include "tests/support/test_scene.h"

namespace sheaf::render {
namespace {

// Smoke of side 1 with velocities of equal speed in all directions.
MediumDescription Smoke(float speed) {
  MediumDescription smoke;
  smoke.sigma_a.rgb = {0.5f, 1, 1.5f};
  smoke.sigma_s.rgb = {3, 2, 1};
  UniformGridMedium grid;
  grid.box = {{16, 16, 16}, {-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}};
  Random random(5);
  for (size_t i = 0; i < grid.box.size(); ++i) {
    const double u = random.Uniform();
    grid.density.push_back(static_cast<float>(4 * u * u * u));
    grid.velocity.push_back(random.Direction() * speed);
  }
  smoke.kind = std::move(grid);
  return smoke;
}

struct RenderedMotion {
  TileMean mean;
  FilmTile film;
};
// Expects that no majorant is violated.
RenderedMotion RenderSmoke(TestScene t, MediumDescription smoke, const FrameSettings& settings) {
  t.scene.media = {std::move(smoke)};
  t.scene.camera.shutter_close = 1;
  const CompiledScenePtr compiled = Compile(t.scene, settings);
  RenderStats stats;
  FilmTile film = RenderAll(*compiled, &stats);
  EXPECT_EQ(stats.raised_majorants, 0u);
  EXPECT_EQ(stats.broken_majorants, 0u);
  EXPECT_EQ(stats.broken_nestings, 0u);
  const TileMean mean = MeanOf(film);
  EXPECT_EQ(mean.non_finite, 0u);
  EXPECT_GT(mean.mean.g, 0.01f);
  return {mean, std::move(film)};
}

// G2, V5: in a room 2^20 times as large or small the bits are the same, whether the smoke moves by
// a billionth of a voxel or by far more than its box.
TEST(MovingVolumeStability, G2ScaleKeepsTheBits) {
  const auto rendered = [](double scale, float speed) {
    TestScene t = LitRoom(scale);
    t.scene.camera.medium = 0;
    MediumDescription smoke = Smoke(speed);
    smoke.scale = static_cast<float>(1 / scale);
    smoke.world_from_medium = ScaleMatrix({scale, scale, scale});
    return RenderSmoke(std::move(t), std::move(smoke), SquareSettings(8, 16, 12));
  };
  for (const float speed : {1e-9f, 0.2f, 50.0f}) {
    SCOPED_TRACE(speed);
    const RenderedMotion one = rendered(1, speed);
    for (const double scale : {0x1p-20, 0x1p20}) {
      const RenderedMotion other = rendered(scale, speed);
      for (const FilmChannel channel :
           {FilmChannel::kRedHi, FilmChannel::kGreenHi, FilmChannel::kBlueHi}) {
        for (size_t i = 0; i < one.film.plane_size(); ++i) {
          ASSERT_EQ(one.film.channel(channel)[i], other.film.channel(channel)[i]) << scale;
        }
      }
    }
  }
}

// Motion below float rounding equals stillness, and a shutter interval of length 0 shows no motion.
TEST(MovingVolumeStability, G2SlowestMotionIsCloseToStatic) {
  const auto rendered = [](float speed) {
    TestScene t = LitRoom(1);
    t.scene.camera.medium = 0;
    return RenderSmoke(std::move(t), Smoke(speed), SquareSettings(8, DrawCount(64, 1024), 12));
  };
  const RenderedMotion still = rendered(0), slow = rendered(1e-9f);
  for (size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(slow.mean.mean[c], still.mean.mean[c],
                5 * std::hypot(slow.mean.standard_error[c], still.mean.standard_error[c]));
  }
}

// V13: the image does not change if the whole scene is rotated about the camera's axis, including
// the smoke and its velocities.
TEST(MovingVolumeStability, V13MovingSmokeIsRotationInvariant) {
  const auto rendered = [](double degrees) {
    const Matrix4 turn = RotateMatrix(degrees, {0, 0, 1});
    TestScene t({0, 0, -4}, {0, 0, 0}, 25, TransformPoint(turn, {0, 1, 0}));
    DistantLight sun;
    sun.radiance.rgb = Rgb::Gray(3);
    sun.from = TransformPoint(turn, {0.5, 1, -0.2});
    sun.to = {0, 0, 0};
    t.scene.lights.push_back({sun, {}, {}, {}});
    const float h = 0.6f;
    t.AddShape(MeshShape{t.Box({-h, -h, -h}, {h, h, h})}, t.AddMaterial(InterfaceMaterial{}), turn)
        .media = {0, kNone};
    MediumDescription smoke = Smoke(0.3f);
    // Adds a wind whose direction is visible.
    for (Vec3f& v : std::get<UniformGridMedium>(smoke.kind).velocity) v += Vec3f{0.5f, 0, 0};
    smoke.world_from_medium = turn;
    return RenderSmoke(std::move(t), std::move(smoke), SquareSettings(8, DrawCount(512, 8192), 12));
  };
  const RenderedMotion straight = rendered(0);
  for (const double degrees : {90.0, 37.0}) {
    const RenderedMotion turned = rendered(degrees);
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(turned.mean.mean[c], straight.mean.mean[c],
                  5 * std::hypot(turned.mean.standard_error[c], straight.mean.standard_error[c]));
    }
  }
}

}  // namespace
}  // namespace sheaf::render
