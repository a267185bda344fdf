// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Rays through lenses where formulas break down: surfaces hit at their rim or tangentially, flat
// and nearly flat ones, total reflection, distant focus, other units.
#include <gtest/gtest.h>

#include <cmath>
#include <utility>
#include <vector>

#include "tests/support/chi_square.h"
#include "tests/support/lenses.h"
#include "worker/render/camera/exit_pupil.h"

namespace sheaf::render {
namespace {

using sheaf::testing::DoubleGauss;
using sheaf::testing::Lens;
using sheaf::testing::MakeLens;

// An aplanatic meniscus images one point without error for all angles: its rear surface is centered
// at the point; its front surface, of radius R and index n, has its center R / n in front of the
// point. All rays leave as if they came from a point n R behind that center. (Born and Wolf, sec.
// 4.2.3.)
TEST(LensStability, AplanaticPointsAreImagedExactlyAtAllAngles) {
  constexpr double kN = 1.5, kR = 30, kRear = 40;
  const LensSystem lens =
      MakeLens(Lens({{kR, kR * (1 + 1 / kN) - kRear, kN, 59.9}, {kRear, 500, 1, 79.9}}));
  const double point_z = lens.rear_z_mm() - kRear;
  const double image_z = lens.front_z_mm() - kR - kN * kR;
  double steepest = 0;
  for (int i = 1; i < 900; ++i) {
    const double angle = i * 0.1 * (3.14159265358979 / 180);
    LensRay ray{{0, 0, point_z}, {std::sin(angle), 0, std::cos(angle)}};
    if (lens.TraceFromFilm(&ray) == 0) continue;
    steepest = angle;
    EXPECT_NEAR(ray.o.z - ray.o.x / ray.d.x * ray.d.z, image_z, 1e-11) << i;
    EXPECT_NEAR(ray.d.x * kN, std::sin(angle), 1e-14) << i;  // Abbe's sine condition.
  }
  EXPECT_GT(steepest, 0.6);
}

// A glass plate in front of the film moves the focus back by d (1 - 1/n). A plate of curvature 1e-9
// / mm must do the same, although the difference of two distances to a center 1000 km away has few
// digits.
TEST(LensStability, NearlyFlatSurfacesAreFlat) {
  const auto make = [](std::vector<LensSurface> surfaces) {
    LensDescription description = Lens(std::move(surfaces));
    description.focus_distance_m = 1e9f;
    return MakeLens(description);
  };
  const LensSystem bare = make({{60, 5, 1.5, 30}, {-60, 70, 1, 30}});
  const LensSystem flat =
      make({{60, 5, 1.5, 30}, {-60, 5, 1, 30}, {0, 10, 1.6, 40}, {0, 50, 1, 40}});
  EXPECT_NEAR(flat.front_z_mm() - bare.front_z_mm(), 10 * (1 - 1 / 1.6), 1e-6);
  for (const double radius : {1e9, -1e9}) {
    const LensSystem lens =
        make({{60, 5, 1.5, 30}, {-60, 5, 1, 30}, {radius, 10, 1.6, 40}, {radius, 50, 1, 40}});
    EXPECT_NEAR(lens.front_z_mm(), flat.front_z_mm(), 1e-6);
    for (uint64_t i = 0; i < 1000; ++i) {
      const auto u = sheaf::testing::CounterUniforms(37, i);
      LensRay a{{5.0 * u[0], 0, 0}, Normalize(Vec3d{6.0 * u[1] - 3, 6.0 * u[2] - 3, 50})};
      LensRay b = a;
      ASSERT_EQ(lens.TraceFromFilm(&a), 1);
      ASSERT_EQ(flat.TraceFromFilm(&b), 1);
      EXPECT_NEAR(Length(a.d - b.d), 0, 1e-7);
    }
  }
}

// The rim of a ball: a ray parallel to the axis at distance R (1 - e) hits it with the cosine
// sqrt(2 e), whose square has an error of about 2^-52 / (2 e). No error is larger than that, and
// none is NaN. At and beyond the rim nothing is hit. Through a ball a ray turns by 2 (incidence -
// refraction).
TEST(LensStability, RaysAtAnEdgeHitOrMissConsistently) {
  constexpr double kR = 10, kN = 1.2;
  const LensSystem ball = MakeLens(Lens({{kR, 2 * kR, kN, 2 * kR}, {-kR, 30, 1, 2 * kR}}));
  for (const double e : {1e-2, 1e-4, 1e-8, 1e-12}) {
    const double height = kR * (1 - e), sine = height / kR;
    LensRay ray{{height, 0, ball.rear_z_min_mm() - 1}, {0, 0, 1}};
    ASSERT_EQ(ball.TraceFromFilm(&ray), 1) << e;
    EXPECT_NEAR(std::atan2(-ray.d.x, ray.d.z), 2 * (std::asin(sine) - std::asin(sine / kN)),
                1e-13 + 2e-14 / std::sqrt(e))
        << e;
    EXPECT_NEAR(Length(ray.d), 1, 1e-14);
  }
  for (const double height : {kR, std::nextafter(kR, 11), 11.0, 1e30}) {
    LensRay ray{{height, 0, ball.rear_z_min_mm() - 1}, {0, 0, 1}};
    EXPECT_EQ(ball.TraceFromFilm(&ray), 0) << height;
  }
}

// On both sides of the critical angle rays are transmitted or blocked, never NaN.
TEST(LensStability, TotalReflectionBlocksRays) {
  // The film looks at a flat face from the glass behind a curved one: from 41.8 degrees on all
  // light is reflected there.
  const LensSystem lens = MakeLens(Lens({{0, 40, 1.5, 2000}, {-30, 60, 1, 59}}));
  int through = 0, held = 0, grazing = 0;
  for (uint64_t i = 0; i < 200000; ++i) {
    const auto u = sheaf::testing::CounterUniforms(5, i);
    const Vec3d o{100.0 * u[0] - 50, 0, 0};
    const Vec3d at{58.0 * u[1] - 29, 58.0 * u[2] - 29, lens.rear_z_mm()};
    LensRay ray{o, Normalize(at - o)};
    const double weight = lens.TraceFromFilm(&ray);
    ASSERT_TRUE(weight == 0 || weight == 1);
    if (weight == 0) {
      ++held;
      continue;
    }
    ++through;
    grazing += ray.d.z < 0.2;
    ASSERT_NEAR(Length(ray.d), 1, 1e-13);
    ASSERT_GT(ray.d.z, 0);
  }
  EXPECT_GT(through, 1000);
  EXPECT_GT(held, 1000);
  EXPECT_GT(grazing, 10);
}

// A lens, its film and its focus distance scaled by two give the same image.
TEST(LensStability, ScaleByPowersOfTwoKeepsTheBits) {
  for (const double scale : {0x1p-10, 2.0, 0x1p10}) {
    LensDescription large = DoubleGauss();
    for (LensSurface& surface : large.surfaces) {
      surface.curvature_radius_mm *= scale;
      surface.thickness_mm *= scale;
      surface.aperture_diameter_mm *= scale;
    }
    large.aperture_diameter_mm *= static_cast<float>(scale);
    large.focus_distance_m *= static_cast<float>(scale);
    large.film_diagonal_mm *= static_cast<float>(scale);
    const LensSystem a = MakeLens(DoubleGauss()), b = MakeLens(large);
    const ExitPupil pupil_a(a, 20), pupil_b(b, 20 * scale);
    EXPECT_EQ(a.focal_length_mm() * scale, b.focal_length_mm());
    for (uint64_t i = 0; i < 1000; ++i) {
      const auto u = sheaf::testing::CounterUniforms(29, i);
      const Vec2d film{10.0 * u[2], -4};
      const PupilSample p = pupil_a.Sample(film, {u[0], u[1]});
      const PupilSample q = pupil_b.Sample(film * scale, {u[0], u[1]});
      ASSERT_EQ(p.p_mm * scale, q.p_mm);
      ASSERT_EQ(p.pdf_per_mm2, q.pdf_per_mm2 * scale * scale);
      LensRay r{{film.x, film.y, 0},
                Normalize(Vec3d{p.p_mm.x - film.x, p.p_mm.y - film.y, a.rear_z_mm()})};
      LensRay s{{film.x * scale, film.y * scale, 0}, r.d};
      const double weight = a.TraceFromFilm(&r);
      ASSERT_EQ(weight, b.TraceFromFilm(&s));
      if (weight == 0) continue;
      ASSERT_EQ(r.d, s.d);
      ASSERT_EQ(r.o * scale, s.o);
    }
  }
}

// A stop of a hundredth of a millimeter, a millionth of the rear surface's area: its pupil is
// found, and most samples are transmitted.
TEST(LensStability, TinyStopsAreFound) {
  LensDescription description = DoubleGauss();
  description.aperture_diameter_mm = 0.01f;
  const LensSystem lens = MakeLens(description);
  const ExitPupil pupil(lens, 21.6);
  for (const double radius : {0.0, 5.0, 20.0}) {
    int through = 0;
    constexpr int kCount = 10000;
    for (uint64_t i = 0; i < kCount; ++i) {
      const auto u = sheaf::testing::CounterUniforms(31, i);
      const PupilSample p = pupil.Sample({0, radius}, {u[0], u[1]});
      LensRay ray{{0, radius, 0}, Normalize(Vec3d{p.p_mm.x, p.p_mm.y - radius, lens.rear_z_mm()})};
      through += lens.TraceFromFilm(&ray) > 0;
    }
    EXPECT_GT(through, kCount / 20) << radius;
  }
}

// Focus at 10^6 km: 1 - sqrt(1 - x) has no digits left there; the lens is then one focal length in
// front of the film.
TEST(LensStability, FarFocusKeepsPrecision) {
  LensDescription description = DoubleGauss();
  description.focus_distance_m = 1e9f;
  const LensSystem far = MakeLens(description);
  description.focus_distance_m = 1e30f;
  const LensSystem farther = MakeLens(description);
  EXPECT_NEAR(far.rear_z_mm(), farther.rear_z_mm(), 2e-8);
  LensRay ray{{0, 0, 0}, Normalize(Vec3d{1e-4, 0, 1})};
  ASSERT_EQ(farther.TraceFromFilm(&ray), 1);
  EXPECT_NEAR(ray.d.x, 0, 1e-9);
}

}  // namespace
}  // namespace sheaf::render
