// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests samples of cameras against their densities, by Pearson's chi-square with 10^6 samples each:
// points of an aperture with blades, times of a shutter, points of an exit pupil. The densities are
// integrated over cells exactly; cells with fewer than 5 expected samples are pooled. The
// false-alarm probability of all 20 tests together is 10^-4 (Sidak), and the seeds are fixed. A
// density that is off by 2 % in a tenth of the cells raises the statistic by 40 above its mean and
// is detected.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

#include "tests/support/chi_square.h"
#include "tests/support/lenses.h"
#include "worker/render/camera/aperture_shape.h"
#include "worker/render/camera/exit_pupil.h"
#include "worker/render/camera/shutter_shape.h"

namespace sheaf::render {
namespace {

constexpr int kSamples = 1000000;
constexpr int kTests = 20;

double PValue(const std::vector<double>& observed, const std::vector<double>& area_fraction) {
  double statistic = 0, pooled_observed = 0, pooled_expected = 0;
  int cells = 0;
  for (size_t i = 0; i < observed.size(); ++i) {
    const double expected = area_fraction[i] * kSamples;
    if (expected >= 5) {
      statistic += (observed[i] - expected) * (observed[i] - expected) / expected;
      ++cells;
    } else {
      pooled_observed += observed[i];
      pooled_expected += expected;
    }
  }
  if (pooled_expected >= 5) {
    statistic +=
        (pooled_observed - pooled_expected) * (pooled_observed - pooled_expected) / pooled_expected;
    ++cells;
  } else {
    EXPECT_LE(pooled_observed, 40) << "samples where there should be none";
  }
  EXPECT_GT(cells, 10);
  return sheaf::testing::UpperGammaQ(0.5 * (cells - 1), 0.5 * statistic);
}

void ExpectChance(double p_value) {
  EXPECT_GT(p_value, sheaf::testing::SidakThreshold(1e-4, kTests));
}

// The part of a polygon to the left of the line through p along d. Source: Sutherland and Hodgman
// 1974.
std::vector<Vec2d> CutOff(const std::vector<Vec2d>& polygon, Vec2d p, Vec2d d) {
  std::vector<Vec2d> kept;
  const auto side = [&](Vec2d q) { return d.x * (q.y - p.y) - d.y * (q.x - p.x); };
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Vec2d a = polygon[i], b = polygon[(i + 1) % polygon.size()];
    const double sa = side(a), sb = side(b);
    if (sa >= 0) kept.push_back(a);
    if ((sa >= 0) != (sb >= 0)) kept.push_back(a + (b - a) * (sa / (sa - sb)));
  }
  return kept;
}
double AreaOf(const std::vector<Vec2d>& polygon) {
  double twice = 0;
  for (size_t i = 0; i < polygon.size(); ++i) {
    const Vec2d a = polygon[i], b = polygon[(i + 1) % polygon.size()];
    twice += a.x * b.y - a.y * b.x;
  }
  return 0.5 * std::fabs(twice);
}

TEST(CameraChi2Test, ApertureIsSampledUniformly) {
  constexpr int kCells = 31;
  uint64_t seed = 100;
  for (const int count : {3, 4, 5, 6, 9, 64}) {
    const double rotation = 7.0 * count;
    SCOPED_TRACE(count);
    const BladePolygon blades(count, rotation);
    std::vector<Vec2d> corners;
    for (int i = 0; i < count; ++i) {
      const double angle = (rotation + 360.0 * i / count) * (std::numbers::pi / 180);
      corners.push_back({std::cos(angle), std::sin(angle)});
    }
    std::vector<double> observed(kCells * kCells), area_fraction(kCells * kCells);
    for (int y = 0; y < kCells; ++y) {
      for (int x = 0; x < kCells; ++x) {
        const Vec2d low{2.0 * x / kCells - 1, 2.0 * y / kCells - 1};
        const Vec2d high{2.0 * (x + 1) / kCells - 1, 2.0 * (y + 1) / kCells - 1};
        std::vector<Vec2d> part = CutOff(corners, low, {1, 0});
        part = CutOff(part, high, {-1, 0});
        part = CutOff(part, low, {0, -1});
        part = CutOff(part, high, {0, 1});
        area_fraction[y * kCells + x] = AreaOf(part) / AreaOf(corners);
      }
    }
    ++seed;
    for (uint64_t i = 0; i < kSamples; ++i) {
      const auto u = sheaf::testing::CounterUniforms(seed, i);
      const Vec2d p = blades.Sample({u[0], u[1]});
      const auto cell = [](double v) {
        return std::clamp(static_cast<int>(0.5 * (v + 1) * kCells), 0, kCells - 1);
      };
      observed[cell(p.y) * kCells + cell(p.x)] += 1;
    }
    ExpectChance(PValue(observed, area_fraction));
  }
}

// Neighboring points stay close, which preserves well-distributed point sets: the map stretches
// distances by a small factor at most, and its only seam is the center.
TEST(CameraChi2Test, ApertureMappingIsContinuous) {
  const BladePolygon blades(5, 20);
  constexpr float kStep = 1.0f / 512;
  for (int y = 1; y < 511; ++y) {
    for (int x = 1; x < 511; ++x) {
      const Vec2f u{static_cast<float>(x) * kStep, static_cast<float>(y) * kStep};
      const Vec2d p = blades.Sample(u);
      for (const Vec2f& next : {Vec2f{u.x + kStep, u.y}, Vec2f{u.x, u.y + kStep}}) {
        const Vec2d q = blades.Sample(next);
        ASSERT_LT(std::hypot(q.x - p.x, q.y - p.y), 6.0 * kStep) << x << " " << y;
      }
    }
  }
}

TEST(CameraChi2Test, ShuttersAreSampledByTheirShape) {
  const std::vector<Vec2f> shapes[] = {
      {{0, 1}, {1, 1}},
      {{0, 0}, {0.5f, 1}, {1, 0}},
      {{0, 0}, {0.25f, 1}, {0.75f, 1}, {1, 0}},
      {{0, 1}, {1, 0}},
      {{0, 0}, {0.1f, 0}, {0.2f, 5}, {0.6f, 0}, {0.7f, 0}, {1, 2}}};
  uint64_t seed = 200;
  for (const std::vector<Vec2f>& knots : shapes) {
    SCOPED_TRACE(knots.size());
    const auto shutter = ShutterShape::Make(knots);
    ASSERT_TRUE(shutter.ok()) << shutter.status();
    constexpr int kCells = 97, kSteps = 1000;
    std::vector<double> observed(kCells), area_fraction(kCells);
    double whole = 0;
    for (int i = 0; i < kCells; ++i) {
      for (int k = 0; k < kSteps; ++k) {
        area_fraction[i] +=
            shutter->Pdf((i + (k + 0.5) / kSteps) / kCells) / (double{kCells} * kSteps);
      }
      whole += area_fraction[i];
    }
    EXPECT_NEAR(whole, 1, 1e-6);
    ++seed;
    for (uint64_t i = 0; i < kSamples; ++i) {
      const float time = shutter->Sample(sheaf::testing::CounterUniforms(seed, i)[0]);
      ASSERT_GE(time, 0);
      ASSERT_LT(time, 1);
      observed[static_cast<int>(double{time} * kCells)] += 1;
    }
    ExpectChance(PValue(observed, area_fraction));
  }
}

TEST(CameraChi2Test, ShutterTimesAscendAndShapesAreChecked) {
  const auto shutter = ShutterShape::Make({{0, 0}, {0.3f, 1}, {0.4f, 0}, {0.6f, 0}, {1, 3}});
  ASSERT_TRUE(shutter.ok());
  float last = 0;
  for (int i = 0; i < 100000; ++i) {
    const float time = shutter->Sample(static_cast<float>(i) * 1e-5f);
    ASSERT_GE(time, last);
    last = time;
  }
  EXPECT_EQ(shutter->Sample(0), 0);
  EXPECT_GT(shutter->Sample(0x1.fffffep-1f), 0.999f);
  EXPECT_TRUE(ShutterShape::Make({})->empty());
  for (const std::vector<Vec2f>& bad :
       std::vector<std::vector<Vec2f>>{{{0, 1}},
                                       {{0, 0}, {1, 0}},
                                       {{0, 1}, {0.5f, 1}},
                                       {{0.1f, 1}, {1, 1}},
                                       {{0, 1}, {0.5f, 1}, {0.5f, 0}, {1, 1}},
                                       {{0, -1}, {1, 3}},
                                       {{0, NAN}, {1, 1}}}) {
    EXPECT_EQ(ShutterShape::Make(bad).status().code(), absl::StatusCode::kInvalidArgument);
  }
}

// Compares points in the pupil's plane, relative to the axis of the film point, with Pdf.
TEST(CameraChi2Test, ExitPupilsAreSampledByTheirPdf) {
  const LensSystem lens = sheaf::testing::MakeLens(sheaf::testing::DoubleGauss());
  const ExitPupil pupil(lens, 22);
  uint64_t seed = 300;
  for (const Vec2d film : {Vec2d{0, 0}, Vec2d{9, 0}, Vec2d{0, -14}, Vec2d{15, 15}, Vec2d{-21, 1}}) {
    SCOPED_TRACE(::testing::Message() << film.x << " " << film.y);
    const double reach = 3 * lens.rear_radius_mm();
    constexpr int kCells = 41;
    std::vector<double> observed(kCells * kCells), area_fraction(kCells * kCells);
    const double radius = std::hypot(film.x, film.y);
    const double cosine = radius == 0 ? 1 : film.x / radius,
                 sine = radius == 0 ? 0 : film.y / radius;
    const auto on_film = [&](double x, double y) {
      return Vec2d{x * cosine - y * sine, x * sine + y * cosine};
    };
    double whole = 0;
    for (int i = 0; i < kCells * kCells; ++i) {
      // The density is constant within two rectangles along these axes.
      const ExitPupil::Box cell{(i % kCells) * 2 * reach / kCells - reach,
                                (i % kCells + 1) * 2 * reach / kCells - reach, 0};
      const double y0 = (i / kCells) * 2 * reach / kCells - reach, y1 = y0 + 2 * reach / kCells;
      const auto overlap = [&](const ExitPupil::Box& box) {
        return std::max(0.0, std::min(cell.x1, box.x1) - std::max(cell.x0, box.x0)) *
               std::max(0.0, std::min(y1, box.y) - std::max(y0, -box.y)) / box.Area();
      };
      area_fraction[i] = kPupilAreaFraction * overlap(pupil.All(radius)) +
                         (1 - kPupilAreaFraction) * overlap(*pupil.Found(radius));
      whole += area_fraction[i];
    }
    EXPECT_NEAR(whole, 1, 1e-9);
    ++seed;
    for (uint64_t i = 0; i < kSamples; ++i) {
      const auto u = sheaf::testing::CounterUniforms(seed, i);
      const PupilSample sample = pupil.Sample(film, {u[0], u[1]});
      const Vec2d own{sample.p_mm.x * cosine + sample.p_mm.y * sine,
                      sample.p_mm.y * cosine - sample.p_mm.x * sine};
      const auto cell = [&](double v) {
        return std::clamp(static_cast<int>((v + reach) / (2 * reach) * kCells), 0, kCells - 1);
      };
      observed[cell(own.y) * kCells + cell(own.x)] += 1;
      if (i < 1000) {
        EXPECT_NEAR(pupil.Pdf(film, on_film(own.x, own.y)) / sample.pdf_per_mm2, 1, 1e-9);
      }
    }
    ExpectChance(PValue(observed, area_fraction));
  }
}

}  // namespace
}  // namespace sheaf::render
