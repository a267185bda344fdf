// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/volume_motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <span>
#include <vector>

#include "common/volume/volume_array.h"
#include "worker/render/medium/heterogeneous_medium.h"
#include "worker/render/sampling/event_stream.h"

namespace sheaf::render {
namespace {

using ::testing::HasSubstr;

// A grid of n^3 values of a function of their position in the box.
template <typename T>
VolumeGrid Grid(const std::string& name, int32_t n, Vec3d lo, Vec3d hi,
                const std::function<T(Vec3d)>& value) {
  std::vector<T> values;
  const Vec3d voxel = (hi - lo) * (1.0 / n);
  for (int32_t z = 0; z < n; ++z) {
    for (int32_t y = 0; y < n; ++y) {
      for (int32_t x = 0; x < n; ++x) {
        values.push_back(value(lo + Vec3d{x + 0.5, y + 0.5, z + 0.5} * voxel));
      }
    }
  }
  auto grid = VolumeGridFromArray("a", name, {{n, n, n}, lo, hi}, std::span<const T>(values));
  EXPECT_TRUE(grid.ok()) << grid.status();
  return *std::move(grid);
}

// Noise in the middle of 48^3 voxels that differ in size per axis; zero around it.
constexpr double kExtent = 48;
VolumeGrid Lumps() {
  EventStream random({5, 0, 0, 0});
  return Grid<float>("density", 48, {0, 0, 0}, {kExtent, 2 * kExtent, kExtent / 2},
                     std::function<float(Vec3d)>([&](Vec3d p) {
                       const Vec3d q = p * Vec3d{1, 0.5, 2} - Vec3d{24, 24, 24};
                       const double u = random.Uniform();
                       return Dot(q, q) < 100 ? static_cast<float>(10 * u * u * u) : 0.0f;
                     }));
}
VolumeGrid Wind(Vec3f v) {
  return Grid<Vec3f>("vel", 4, {-400, -400, -400}, {400, 400, 400},
                     std::function<Vec3f(Vec3d)>([v](Vec3d) { return v; }));
}
// The velocity grid is coarser than the density, and offset from it.
VolumeGrid Swirls(float speed) {
  EventStream random({6, 0, 0, 0});
  const auto any = [&random, speed] { return speed * static_cast<float>(random.Uniform() - 0.5); };
  return Grid<Vec3f>("vel", 17, {-13, -11, -7}, {60, 101, 40},
                     std::function<Vec3f(Vec3d)>([any](Vec3d) {
                       const float x = any(), y = any();
                       return Vec3f{x, y, any()};
                     }));
}

HeterogeneousMedium Moving(VolumeGrid velocities, double duration = 1,
                           const Affine& placement = {}) {
  VolumeGrid density = Lumps();
  auto motion = VolumeMotion::Make("a", std::move(velocities), duration, density);
  EXPECT_TRUE(motion.ok()) << motion.status();
  auto medium =
      HeterogeneousMedium::FromMovingGrid("a", std::move(density), *std::move(motion),
                                          {.render_from_medium = placement, .extinction_max = 3});
  EXPECT_TRUE(medium.ok()) << medium.status();
  return *std::move(medium);
}
HeterogeneousMedium Still() {
  return *HeterogeneousMedium::FromGrid("a", Lumps(),
                                        {.render_from_medium = {}, .extinction_max = 3});
}

// Counts the lookups along random rays, at random times, that violate the bounds.
struct Check {
  int look_ups = 0, positive = 0, violations = 0;
};
Check CheckBounds(const MajorantGrid& bounds, const HeterogeneousMedium& medium) {
  Check check;
  EventStream random({8, 1, 2, 3});
  const auto point = [&] {
    return Vec3d{random.Uniform(), random.Uniform(), random.Uniform()} * Vec3d{96, 192, 48} -
           Vec3d{24, 48, 12};
  };
  for (int i = 0; i < 3000; ++i) {
    const Vec3d o = point(), d = i % 7 == 0 ? Vec3d{1, 0, 0} : point() - o;
    const double time = i % 5 == 0 ? 1 : random.Uniform();
    const Vec3d voxels{1, 0.5, 2}, half{0.5, 0.5, 0.5};
    MajorantWalk walk(bounds, o * voxels - half, d * voxels, 0, 1);
    for (MajorantSegment s; walk.Next(&s);) {
      for (int k = 0; k < 3; ++k) {
        const double t = s.t0 + (s.t1 - s.t0) * random.Uniform();
        const double density = medium.DensityAt(o + t * d, time);
        ++check.look_ups;
        check.positive += density > 0;
        check.violations += density > s.bounds.upper || density < s.bounds.lower;
      }
    }
  }
  return check;
}

TEST(VolumeMotionTest, BoundsHoldEverywhereAtAllTimes) {
  for (const float speed : {0.3f, 15.0f, 60.0f}) {
    SCOPED_TRACE(speed);
    const HeterogeneousMedium medium = Moving(Swirls(speed));
    const Check moving = CheckBounds(medium.majorants(), medium);
    EXPECT_GT(moving.positive, 300);
    EXPECT_EQ(moving.violations, 0);
    // The bounds of the static medium are too low for the moving one.
    const HeterogeneousMedium still = Still();
    if (speed > 1) {
      EXPECT_GT(CheckBounds(still.majorants(), medium).violations, 100);
    }
    TrackingTally tally;
    EventStream random({3, 1, 4, 1});
    for (uint32_t i = 0; i < 3000; ++i) {
      const Vec3d o{-20, 96 * random.Uniform(), 24 * random.Uniform()};
      const Vec3d d = Normalize(Vec3d{1, random.Uniform() - 0.5, random.Uniform() - 0.5});
      const double time = random.Uniform();
      EventStream stream({i, 0, 0, 0});
      medium.SampleCollision(o, d, 100, Rgb{3, 2, 1}, Rgb::Gray(1), &stream, &tally, time);
      medium.Transmittance(o, d, 100, Rgb{3, 2, 1}, &stream, &tally, time);
    }
    EXPECT_EQ(tally.violation_count, 0u);
    EXPECT_GT(tally.look_up_count, 3000u);
  }
}

// Regions that no smoke reaches while the shutter is open stay empty, even if other smoke is fast.
TEST(VolumeMotionTest, BoundsAreLocal) {
  const HeterogeneousMedium medium = Moving(Grid<Vec3f>(
      "vel", 40, {-40, -40, -40}, {80, 120, 60}, std::function<Vec3f(Vec3d)>([](Vec3d p) {
        return p.x > 30 ? Vec3f{40, 0, 0} : Vec3f{};
      })));
  // At x = 20 the velocity is 0: the bounds are close to those of the static medium.
  const IndexBox region{{18, 0, 0}, {22, 48, 48}};
  const HeterogeneousMedium still = Still();
  EXPECT_EQ(medium.majorants().BoundsOver({{4, 0, 0}, {8, 48, 48}}).upper, 0);
  EXPECT_EQ(still.majorants().BoundsOver({{4, 0, 0}, {8, 48, 48}}).upper, 0);
  EXPECT_LE(medium.majorants().BoundsOver(region).upper,
            still.majorants().BoundsOver({{14, 0, 0}, {26, 48, 48}}).upper);
  EXPECT_GT(medium.majorants().BoundsOver({{60, 0, 0}, {64, 48, 48}}).upper, 1);
  // The box grows by the displacement, in its direction only.
  EXPECT_NEAR(medium.majorants().box().hi.x, still.majorants().box().hi.x + 40, 1e-9);
  EXPECT_EQ(medium.majorants().box().lo.x, still.majorants().box().lo.x);
  EXPECT_EQ(medium.majorants().box().lo.y, still.majorants().box().lo.y);
}

TEST(VolumeMotionTest, UniformVelocityMovesEverythingEqually) {
  const Vec3d wind{7, -9, 2.5};
  const HeterogeneousMedium medium = Moving(Wind(ToFloat(wind)), 0.5), still = Still();
  EventStream random({1, 1, 1, 1});
  int positive = 0;
  for (int i = 0; i < 5000; ++i) {
    const Vec3d p =
        Vec3d{random.Uniform(), random.Uniform(), random.Uniform()} * kExtent * Vec3d{1, 2, 0.5};
    const double time = random.Uniform();
    const double expected = still.DensityAt(p - 0.5 * time * wind);
    ASSERT_NEAR(medium.DensityAt(p, time), expected, 1e-4);
    positive += expected > 0;
    ASSERT_EQ(medium.DensityAt(p, 0.0), still.DensityAt(p));
    ASSERT_NEAR(Length(medium.OriginOf(p, time) - (p - 0.5 * time * wind)), 0, 1e-9);
  }
  EXPECT_GT(positive, 100);
}

// A rotation and scale of the medium applies to the wind, too.
TEST(VolumeMotionTest, VelocitiesAreInMediumSpace) {
  const Affine placement{{0, 3, 0}, {-3, 0, 0}, {0, 0, 3}, {5, 6, 7}};
  const HeterogeneousMedium medium = Moving(Wind({2, 0, 0}), 1, placement);
  const Vec3d p = placement.Point({24, 48, 12});
  EXPECT_NEAR(Length(medium.OriginOf(p, 0.5) - (p - Vec3d{0, 3, 0})), 0, 1e-9);
}

// Velocities are 0 outside their grid.
TEST(VolumeMotionTest, OutsideTheVelocityGridNothingMoves) {
  const HeterogeneousMedium medium = Moving(
      Grid<Vec3f>("vel", 8, {20, 40, 8}, {28, 56, 16}, std::function<Vec3f(Vec3d)>([](Vec3d) {
                    return Vec3f{3, 3, 3};
                  })));
  EXPECT_EQ(medium.OriginOf({10, 48, 12}, 1), (Vec3d{10, 48, 12}));
  EXPECT_NEAR(Length(medium.OriginOf({24, 48, 12}, 1) - Vec3d{21, 45, 9}), 0, 1e-9);
  EXPECT_EQ(CheckBounds(medium.majorants(), medium).violations, 0);
}

// The mean transmittance over the shutter interval, against quadrature in space and time.
TEST(VolumeMotionTest, TransmittanceIsTheMeanOverTheShutter) {
  const Vec3d wind{0, 20, 6};
  const HeterogeneousMedium medium = Moving(Wind(ToFloat(wind))), still = Still();
  const Vec3d o{-5, 52, 13}, d{1, 0, 0};
  constexpr double kLength = 60, kSigma = 0.1;
  double expected = 0;
  constexpr int kTimes = 400, kSteps = 2000;
  for (int j = 0; j < kTimes; ++j) {
    double depth = 0;
    for (int i = 0; i < kSteps; ++i) {
      const Vec3d p = o + (i + 0.5) * kLength / kSteps * d;
      depth += still.DensityAt(p - (j + 0.5) / kTimes * wind);
    }
    expected += std::exp(-kSigma * depth * kLength / kSteps) / kTimes;
  }
  double sum = 0, squares = 0;
  constexpr uint32_t kWalks = 40000;
  TrackingTally tally;
  for (uint32_t i = 0; i < kWalks; ++i) {
    EventStream stream({i, 2, 0, 0});
    const double time = stream.Uniform();
    const auto passed = medium.Transmittance(o, d, kLength, Rgb::Gray(static_cast<float>(kSigma)),
                                             &stream, &tally, time);
    sum += passed.g;
    squares += static_cast<double>(passed.g) * static_cast<double>(passed.g);
  }
  const double mean = sum / kWalks;
  const double error = std::sqrt((squares / kWalks - mean * mean) / kWalks);
  // 4.5 standard errors: a correct mean fails with probability 7e-6. The quadrature's own error is
  // below 1e-4.
  EXPECT_NEAR(mean, expected, 4.5 * error + 1e-4);
  EXPECT_LT(error, 0.005);
  EXPECT_EQ(tally.violation_count, 0u);
  // The result differs from that at shutter open.
  double at_first = 0;
  for (int i = 0; i < kSteps; ++i)
    at_first += still.DensityAt(o + (i + 0.5) * kLength / kSteps * d);
  EXPECT_GT(std::fabs(std::exp(-kSigma * at_first * kLength / kSteps) - expected), 20 * error);
}

TEST(VolumeMotionTest, InvalidVelocitiesAreRefused) {
  const VolumeGrid density = Lumps();
  const auto message = [&density](VolumeGrid velocities, double duration) {
    const auto motion = VolumeMotion::Make("a.pbrt:3:1", std::move(velocities), duration, density);
    return std::string(motion.status().message());
  };
  EXPECT_THAT(message(Lumps(), 1),
              HasSubstr("a.pbrt:3:1: grid \"density\" holds numbers, but velocities are vectors"));
  EXPECT_THAT(message(Wind({0, 0, 513}), 1),
              HasSubstr("a.pbrt:3:1: grid \"vel\" moves the medium by up to 1026 voxels"));
  EXPECT_EQ(message(Wind({0, 0, 512}), 1), "");
  EXPECT_THAT(message(Wind({0, 0, 1}), 1e300), HasSubstr("more than the limit of 1024"));
  EXPECT_THAT(message(Wind({0, 0, 1}), std::nan("")), HasSubstr("more than the limit of 1024"));
}

}  // namespace
}  // namespace sheaf::render
