// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests EmissionPoints: points follow their pdf, which is positive wherever there is emission and
// integrates to 1; and the density of a line is the pdf's integral along it.
#include "worker/render/medium/emission_points.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "common/math/elementary.h"
#include "tests/support/flames.h"
#include "worker/render/sampling/event_stream.h"

namespace sheaf::render {
namespace {

using testing::Flame;
using testing::MakeFlame;
using testing::Uneven;

const Affine kAside{{0, 0.5, 0}, {-0.5, 0, 0.2}, {0, 0, 0.7}, {-1, 1, 0.3}};
constexpr Rgb kOfOther{0.2f, 2, 0.1f};
const EmissionPoints::Body kBall{{1, 2.2, -0.3}, {2, 2.9, 0.4}, 0.3, 0.6};

EmissionPoints::Point NextPoint(const EmissionPoints& points, EventStream* random) {
  const auto next = [&] { return static_cast<float>(random->Uniform() * (1 - 0x1p-24)); };
  const double choice = random->Uniform();
  return points.Sample(choice, {next(), next(), next()});
}

// Pearson's chi-square in cells of space (converted to a normal deviate, Wilson and Hilferty 1931;
// at most 5), and the emission that the points carry, within 5 standard errors.
TEST(EmissionPointsTest, PointsFollowTheirPdf) {
  const Flame one = MakeFlame(Uneven(1), {}), other = MakeFlame(Uneven(2), kAside);
  const EmissionPoints points({one.source(), other.source(kOfOther)}, {kBall});
  // The luminance that is emitted at a point, per volume and solid angle.
  const auto emission_at = [&](Vec3d p) {
    bool in_ball = true;
    for (size_t a = 0; a < 3; ++a) in_ball &= p[a] >= kBall.lower[a] && p[a] < kBall.upper[a];
    return one.density->DensityAt(p) + double{Luminance(kOfOther)} * other.density->DensityAt(p) +
           (in_ball ? kBall.emission : 0);
  };
  // Cells of a box around all.
  constexpr int kCells = 8, kFine = 24;
  const Vec3d low{-2, -0.5, -0.5}, high{3.5, 3, 1.9};
  const auto cell_of = [&](Vec3d p) {
    size_t index = 0;
    for (size_t a = 0; a < 3; ++a) {
      const double at = (p[a] - low[a]) / (high[a] - low[a]);
      index = index * kCells + static_cast<size_t>(std::clamp(at * kCells, 0.0, kCells - 1.0));
    }
    return index;
  };
  std::vector<double> expected(kCells * kCells * kCells), observed(expected.size());
  constexpr int kAcross = kCells * kFine, kSamples = 100000;
  const Vec3d size = (high - low) / kAcross;
  double total = 0, power = 0;
  for (int i = 0; i < kAcross * kAcross * kAcross; ++i) {
    const Vec3d p =
        low + Vec3d{(i / (kAcross * kAcross) + 0.5) * size.x,
                    (i / kAcross % kAcross + 0.5) * size.y, (i % kAcross + 0.5) * size.z};
    const double mass = points.Pdf(ToFloat(p)) * size.x * size.y * size.z;
    expected[cell_of(p)] += mass * kSamples;
    total += mass;
    power += emission_at(p) * size.x * size.y * size.z;
  }
  EXPECT_NEAR(total, 1, 5e-3);
  EventStream random({11, 7, 8, 9});
  double sum = 0, squares = 0;
  int outside = 0;
  for (int i = 0; i < kSamples; ++i) {
    const EmissionPoints::Point point = NextPoint(points, &random);
    outside += !(point.pdf > 0);
    if (!(point.pdf > 0)) continue;
    ASSERT_EQ(point.pdf, points.Pdf(point.p));
    observed[cell_of(ToDouble(point.p))] += 1;
    const double value = emission_at(ToDouble(point.p)) / point.pdf;
    sum += value;
    squares += value * value;
  }
  EXPECT_LE(outside, 10);
  const double mean = sum / kSamples, error = std::sqrt(squares / kSamples - mean * mean) / 316;
  EXPECT_NEAR(mean, power, 5 * error + 5e-3 * power);
  EXPECT_LT(error, 0.01 * mean);
  EXPECT_NEAR(points.power(), 4 * kPi * power, 0.02 * points.power());
  double statistic = 0;
  int cells = 0;
  for (size_t i = 0; i < expected.size(); ++i) {
    const double e = expected[i] / total;
    EXPECT_TRUE(e > 0 || observed[i] == 0);
    // The midpoint rule knows the cells at the edges of the boxes less well.
    if (e < 100) continue;
    statistic += (observed[i] - e) * (observed[i] - e) / (e + 4e-4 * e * e);
    ++cells;
  }
  const double k = std::max(cells - 1, 1);
  const double deviate = (std::cbrt(statistic / k) - (1 - 2 / (9 * k))) / std::sqrt(2 / (9 * k));
  EXPECT_LE(deviate, 5) << cells << " cells";
  EXPECT_GT(cells, 60);
}

// Light paths would miss emission at a place without points, and the camera's would not make up
// for it.
TEST(EmissionPointsTest, PointsAreWhereverThereIsDensity) {
  // Bright in one corner only, which the other places do not show.
  std::vector<float> factors(48);
  factors[0] = 1;
  std::vector<float> half(48);
  for (size_t i = 0; i < half.size(); ++i) half[i] = i % 6 < 3 ? 1.0f : 0.0f;
  const Flame flame = MakeFlame(half, {}, factors);
  const EmissionPoints points({flame.source()}, {});
  ASSERT_FALSE(points.empty());
  EventStream random({5, 7, 8, 9});
  int dark = 0;
  for (int i = 0; i < 10000; ++i) {
    const Vec3d p{3 * random.Uniform(), 2 * random.Uniform(), random.Uniform()};
    if (!(flame.density->DensityAt(p) > 0)) continue;
    EXPECT_GT(points.Pdf(ToFloat(p)), 0) << p.x << " " << p.y << " " << p.z;
    dark += flame.emission->At<Rgb>(p, {}).IsBlack();
  }
  EXPECT_GT(dark, 1000);
  EXPECT_EQ(points.Pdf({1, 1, 1.1f}), 0);
  // A source without any emission that is seen has some, too: its colors may be spectra.
  const Flame unseen = MakeFlame(std::vector<float>(48, 1.0f), kAside, std::vector<float>(48));
  const EmissionPoints both({flame.source(), unseen.source()}, {});
  EXPECT_GT(both.Pdf(ToFloat(kAside.Point({1, 1, 0.5}))), 0);
}

TEST(EmissionPointsTest, LinesHaveTheIntegralOfTheirPoints) {
  const Flame one = MakeFlame(Uneven(1), {}), other = MakeFlame(Uneven(2), kAside);
  EmissionPoints::Body thin = kBall;
  thin.extinction = 0;
  const EmissionPoints points({one.source(), other.source(kOfOther)}, {thin});
  EventStream random({3, 7, 8, 9});
  int hits = 0;
  for (int i = 0; i < 50; ++i) {
    const Vec3f p =
        ToFloat({8 * random.Uniform() - 4, 8 * random.Uniform() - 4, 8 * random.Uniform() - 4});
    const Vec3d target{3 * random.Uniform() - 0.5, 3 * random.Uniform(), random.Uniform()};
    const Vec3f w = ToFloat(Normalize(target - ToDouble(p)));
    constexpr int kSteps = 20000;
    constexpr double kLength = 16;
    double sum = 0;
    for (int step = 0; step < kSteps; ++step) {
      const double t = (step + 0.5) * kLength / kSteps;
      sum += points.Pdf(ToFloat(ToDouble(p) + t * ToDouble(w)));
    }
    sum *= kLength / kSteps;
    EXPECT_NEAR(points.LineDensity(p, w), sum, 2e-3 + 2e-3 * sum);
    hits += sum > 0.01;
  }
  EXPECT_GT(hits, 25);
}

// A thick body emits through its surface: neither its power nor the density of lines through it
// grows with its depth.
TEST(EmissionPointsTest, ThickBodiesEmitThroughTheirSurface) {
  const EmissionPoints::Body thick{{0, 0, 0}, {1, 1, 1}, 100, 50};
  const EmissionPoints points({}, {thick});
  EXPECT_NEAR(points.power(), kPi * 6 * 2, 1e-9);
  EXPECT_NEAR(points.Pdf({0.5f, 0.5f, 0.5f}), 1, 1e-12);
  EXPECT_NEAR(points.LineDensity({0.5f, 0.5f, 5}, {0, 0, -1}), 1.0 / 50, 1e-9);
  EXPECT_EQ(points.LineDensity({0.5f, 0.5f, 5}, {0, 0, 1}), 0);
  EXPECT_EQ(points.LineDensity({1.5f, 0.5f, 5}, {0, 0, -1}), 0);
}

TEST(EmissionPointsTest, WithoutEmissionThereAreNoPoints) {
  const Flame dark = MakeFlame(std::vector<float>(48, 0.0f), {});
  const Flame bright = MakeFlame(Uneven(3), {});
  const EmissionPoints::Body black{{0, 0, 0}, {1, 1, 1}, 0, 1}, flat{{0, 0, 0}, {1, 1, 0}, 1, 1};
  EXPECT_TRUE(EmissionPoints().empty());
  EXPECT_TRUE(EmissionPoints({dark.source()}, {}).empty());
  EXPECT_TRUE(EmissionPoints({bright.source(Rgb{})}, {black, flat}).empty());
  EXPECT_FALSE(EmissionPoints({dark.source(), bright.source()}, {}).empty());
}

}  // namespace
}  // namespace sheaf::render
