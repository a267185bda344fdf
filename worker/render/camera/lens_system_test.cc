// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Lenses against closed-form optics.
#include "worker/render/camera/lens_system.h"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/support/chi_square.h"
#include "tests/support/lenses.h"
#include "worker/render/camera/exit_pupil.h"
#include "worker/render/camera/realistic_lens.h"

namespace sheaf::render {
namespace {

using sheaf::testing::DoubleGauss;
using sheaf::testing::Lens;
using sheaf::testing::MakeLens;

// n = 1.5, radii 50 and -80, 6 thick: the lensmaker's equation for thick lenses, Hecht, Optics,
// sec. 6.1.
TEST(LensSystemTest, FocalLengthMatchesTheLensmakersEquation) {
  const LensSystem lens = MakeLens(Lens({{50, 6, 1.5, 30}, {-80, 60, 1, 30}}));
  const double n = 1.5, r1 = 50, r2 = -80, d = 6;
  const double power = (n - 1) * (1 / r1 - 1 / r2 + (n - 1) * d / (n * r1 * r2));
  EXPECT_NEAR(lens.focal_length_mm(), 1 / power, 1e-4);
}

// The published focal length of the Double Gauss lens: 99.93 at the nominal scale of 100.
TEST(LensSystemTest, DoubleGaussHasItsFocalLength) {
  EXPECT_NEAR(MakeLens(DoubleGauss()).focal_length_mm(), 100, 1.5);
}

// A point on the axis at the focus distance is imaged to the center of the film.
TEST(LensSystemTest, FocusesAtItsDistance) {
  for (const float distance_m : {0.6f, 2.0f, 50.0f, 1e6f}) {
    LensDescription description = DoubleGauss();
    description.focus_distance_m = distance_m;
    const LensSystem lens = MakeLens(description);
    LensRay ray{{0, 0, 0}, Normalize(Vec3d{1e-3, 0, 1})};
    ASSERT_EQ(lens.TraceFromFilm(&ray), 1);
    // In diopters, so that distant points need no larger tolerance.
    const double crosses_mm = ray.o.z - ray.o.x / ray.d.x * ray.d.z;
    EXPECT_NEAR(1000 / crosses_mm, 1 / static_cast<double>(distance_m), 2e-4) << distance_m;
  }
}

TEST(LensSystemTest, FocusErrorsNameTheNearestDistance) {
  LensDescription description = DoubleGauss();
  description.focus_distance_m = 0.3f;
  const auto lens = LensSystem::Make(description, {});
  ASSERT_FALSE(lens.ok());
  EXPECT_NE(std::string(lens.status().message()).find("is nearer than this lens can be focused"),
            std::string::npos)
      << lens.status();
  EXPECT_FALSE(LensSystem::Make(Lens({{-50, 6, 1.5, 30}, {50, 60, 1, 30}}), {}).ok());
  EXPECT_FALSE(LensSystem::Make({}, {}).ok());
}

// Light paths are reversible.
TEST(LensSystemTest, PathsAreReversible) {
  const LensSystem lens = MakeLens(DoubleGauss());
  int passed = 0;
  for (uint64_t i = 0; i < 2000; ++i) {
    const auto u = sheaf::testing::CounterUniforms(7, i);
    const Vec3d o{40.0 * u[0] - 20, 0, 0};
    const Vec3d d = Normalize(Vec3d{60.0 * u[1] - 30 - o.x, 60.0 * u[2] - 30, lens.rear_z_mm()});
    LensRay ray{o, d};
    if (lens.TraceFromFilm(&ray) == 0) continue;
    ++passed;
    LensRay back{ray.o + ray.d * 10, -ray.d};
    ASSERT_TRUE(lens.TraceFromScene(&back));
    const Vec3d on_film = back.o - back.d * (back.o.z / back.d.z);
    EXPECT_NEAR(Length(on_film - o), 0, 1e-10);
    EXPECT_NEAR(Length(back.d + d), 0, 1e-12);
  }
  EXPECT_GT(passed, 200);
}

// A lens inverts the image on the film; the resulting image is upright.
TEST(LensSystemTest, ImagesAreUpright) {
  SceneDescription scene;
  scene.camera.kind = CameraDescription::Kind::kRealistic;
  scene.camera.lens = DoubleGauss();
  const auto lens = RealisticLens::Make(scene, 300, 200, nullptr);
  ASSERT_TRUE(lens.ok()) << lens.status();
  const auto direction = [&](Vec2d film) {
    for (uint64_t i = 0;; ++i) {
      const auto u = sheaf::testing::CounterUniforms(3, i);
      LensRay ray;
      if (lens->MakeRay(film, {u[0], u[1]}, &ray) > 0) return ray.d;
    }
  };
  EXPECT_LT(direction({0.1, 0.5}).x, -0.05);
  EXPECT_GT(direction({0.9, 0.5}).x, 0.05);
  EXPECT_GT(direction({0.5, 0.1}).y, 0.03);
  EXPECT_LT(direction({0.5, 0.9}).y, -0.03);
  EXPECT_NEAR(lens->extent_mm().x / lens->extent_mm().y, 1.5, 1e-12);
  EXPECT_NEAR(std::hypot(lens->extent_mm().x, lens->extent_mm().y), 35, 1e-9);
}

// 300000 samples per radius: those guided by the boxes and those over the whole visible rear
// aperture have the same mean. Two-sided at 5 standard errors, twelve radii and apertures: one
// false alarm in 10^5 runs, and the seeds are fixed. Power: the uniform samples are the noisier
// ones; if a fraction s of them passes, the test detects a loss of 5 sqrt((1 - s) / (s * 300000))
// of the light, a few percent at full aperture and tens of percent through the smallest stop.
TEST(ExitPupilTest, NoLightIsLost) {
  for (const float aperture_mm : {34.2f, 12.0f, 2.0f}) {
    LensDescription description = DoubleGauss();
    description.aperture_diameter_mm = aperture_mm;
    const LensSystem lens = MakeLens(description);
    const ExitPupil pupil(lens, 40);
    for (const double radius : {0.0, 9.0, 21.6, 39.9}) {
      SCOPED_TRACE(::testing::Message() << aperture_mm << " " << radius);
      const auto value = [&](Vec2d p) {
        LensRay ray{{radius, 0, 0}, Normalize(Vec3d{p.x - radius, p.y, lens.rear_z_mm()})};
        return lens.TraceFromFilm(&ray);
      };
      const ExitPupil::Box all = pupil.All(radius);
      double steered = 0, steered_squares = 0, even = 0, even_squares = 0;
      constexpr int kCount = 300000;
      for (uint64_t i = 0; i < kCount; ++i) {
        const auto u = sheaf::testing::CounterUniforms(11, i);
        const PupilSample sample = pupil.Sample({radius, 0}, {u[0], u[1]});
        const double a = value(sample.p_mm) / sample.pdf_per_mm2;
        const double b = value({all.x0 + static_cast<double>(u[1]) * (all.x1 - all.x0),
                                (2 * static_cast<double>(u[2]) - 1) * all.y}) *
                         all.Area();
        steered += a;
        steered_squares += a * a;
        even += b;
        even_squares += b * b;
      }
      const auto variance = [](double sum, double squares) {
        return (squares / kCount - sum / kCount * (sum / kCount)) / kCount;
      };
      const double error =
          std::sqrt(variance(steered, steered_squares) + variance(even, even_squares));
      EXPECT_LE(std::fabs(steered - even) / kCount, 5 * error);
    }
  }
}

// The conservative direction: of a million uniform rays, those that pass the lens are within the
// boxes found.
TEST(ExitPupilTest, BoxesContainTransmittedRays) {
  const LensSystem lens = MakeLens(DoubleGauss());
  const ExitPupil pupil(lens, 25);
  int passed = 0, outside = 0;
  for (uint64_t i = 0; i < 1000000; ++i) {
    const auto u = sheaf::testing::CounterUniforms(13, i);
    const double radius = 25 * static_cast<double>(u[0]);
    const ExitPupil::Box all = pupil.All(radius);
    const Vec2d p{all.x0 + static_cast<double>(u[1]) * (all.x1 - all.x0),
                  (2 * static_cast<double>(u[2]) - 1) * all.y};
    LensRay ray{{radius, 0, 0}, Normalize(Vec3d{p.x - radius, p.y, lens.rear_z_mm()})};
    if (lens.TraceFromFilm(&ray) == 0) continue;
    ++passed;
    outside += pupil.Found(radius).has_value() && pupil.Found(radius)->Holds(p) ? 0 : 1;
  }
  EXPECT_GT(passed, 10000);
  EXPECT_EQ(outside, 0);
}

// Boxes that are much too small, from the stopped-down lens, only add noise: the mean stays.
TEST(ExitPupilTest, WrongBoxesLoseNoLight) {
  LensDescription stopped = DoubleGauss();
  stopped.aperture_diameter_mm = 8;
  const LensSystem lens = MakeLens(DoubleGauss());
  const ExitPupil right(lens, 22), wrong(MakeLens(stopped), 22);
  ASSERT_LT(wrong.Found(10)->Area(), 0.2 * right.Found(10)->Area());
  const Vec2d film{6, -8};
  double sums[2] = {}, squares[2] = {};
  constexpr int kCount = 2000000;
  for (uint64_t i = 0; i < kCount; ++i) {
    const auto u = sheaf::testing::CounterUniforms(17, i);
    for (int k = 0; k < 2; ++k) {
      const PupilSample sample = (k == 0 ? right : wrong).Sample(film, {u[0], u[1]});
      LensRay ray{
          {film.x, film.y, 0},
          Normalize(Vec3d{sample.p_mm.x - film.x, sample.p_mm.y - film.y, lens.rear_z_mm()})};
      const double value = lens.TraceFromFilm(&ray) / sample.pdf_per_mm2;
      sums[k] += value / kCount;
      squares[k] += value * value / kCount;
    }
  }
  const double error =
      std::sqrt((squares[0] - sums[0] * sums[0] + squares[1] - sums[1] * sums[1]) / kCount);
  EXPECT_LE(std::fabs(sums[0] - sums[1]), 5 * error);
  EXPECT_LT(error, 0.02 * sums[0]);
}

// At the center of the film the irradiance of a constant scene of radiance 1 is pi sin^2 of the
// marginal ray's angle, through any lens (Kolb et al. 1995, sec. 4): found here by bisection.
TEST(RealisticLensTest, WeightsMatchTheFilmIrradiance) {
  for (const float aperture_mm : {34.2f, 10.0f}) {
    SceneDescription scene;
    scene.camera.kind = CameraDescription::Kind::kRealistic;
    scene.camera.lens = DoubleGauss();
    scene.camera.lens.aperture_diameter_mm = aperture_mm;
    const auto lens = RealisticLens::Make(scene, 300, 200, nullptr);
    ASSERT_TRUE(lens.ok()) << lens.status();
    double passes = 0, held = 1;
    for (int i = 0; i < 60; ++i) {
      const double sine = 0.5 * (passes + held);
      LensRay ray{{0, 0, 0}, {sine, 0, std::sqrt(1 - sine * sine)}};
      (lens->lens().TraceFromFilm(&ray) > 0 ? passes : held) = sine;
    }
    double sum = 0, squares = 0;
    constexpr int kCount = 400000;
    for (uint64_t i = 0; i < kCount; ++i) {
      const auto u = sheaf::testing::CounterUniforms(19, i);
      LensRay ray;
      const double weight = lens->MakeRay({0.5, 0.5}, {u[0], u[1]}, &ray);
      sum += weight / kCount;
      squares += weight * weight / kCount;
    }
    const double error = std::sqrt((squares - sum * sum) / kCount);
    EXPECT_NEAR(sum, 3.14159265358979 * passes * passes, 4 * error);
    EXPECT_LT(error, 0.003 * sum);
  }
}

// All shapes of the stop transmit as much light as the disk: near the axis exactly, where the stop
// alone decides.
TEST(RealisticLensTest, ApertureShapesAreEquallyBright) {
  using Aperture = LensDescription::Aperture;
  double disk = 0;
  for (const Aperture aperture : {Aperture::kDisk, Aperture::kGaussian, Aperture::kSquare,
                                  Aperture::kPentagon, Aperture::kStar}) {
    SceneDescription scene;
    scene.camera.kind = CameraDescription::Kind::kRealistic;
    scene.camera.lens = DoubleGauss();
    scene.camera.lens.aperture_diameter_mm = 4;
    scene.camera.lens.aperture = aperture;
    const auto lens = RealisticLens::Make(scene, 300, 200, nullptr);
    ASSERT_TRUE(lens.ok()) << lens.status();
    double sum = 0;
    constexpr int kCount = 400000;
    for (uint64_t i = 0; i < kCount; ++i) {
      const auto u = sheaf::testing::CounterUniforms(23, i);
      LensRay ray;
      sum += lens->MakeRay({0.5, 0.5}, {u[0], u[1]}, &ray) / kCount;
    }
    if (aperture == Aperture::kDisk) disk = sum;
    EXPECT_NEAR(sum / disk, 1, 0.01) << static_cast<int>(aperture);
  }
}

}  // namespace
}  // namespace sheaf::render
