// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/heterogeneous_medium.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "common/volume/volume_array.h"

namespace sheaf::render {
namespace {

VolumeGrid Wedge() {
  std::vector<float> values(20 * 20 * 20);
  for (size_t i = 0; i < values.size(); ++i) values[i] = static_cast<float>(i % 20) / 10;
  auto grid = VolumeGridFromArray("a", "density", {{20, 20, 20}, {}, {1, 1, 1}}, values);
  return *std::move(grid);
}

// Scaling the medium by 2^k and its extinction by 2^-k changes no bit of transmittance and
// collisions.
TEST(HeterogeneousMediumTest, ScaleChangesNoBit) {
  const auto at_scale = [](int k) {
    const double s = std::ldexp(1.0, k);
    const HeterogeneousMedium::Placement placement{
        .render_from_medium = {{s, 0, 0}, {0, s, 0}, {0, 0, s}, {0.5 * s, 0, 0}},
        .extinction_max = 3 / s};
    return *HeterogeneousMedium::FromGrid("a", Wedge(), placement);
  };
  const HeterogeneousMedium plain = at_scale(0);
  int collision_count = 0;
  for (const int k : {-40, 40}) {
    const HeterogeneousMedium scaled = at_scale(k);
    const double s = std::ldexp(1.0, k);
    for (uint32_t i = 0; i < 500; ++i) {
      const Vec3d o{-1, 0.3, 0.4}, d = Normalize(Vec3d{1, 0.001 * i - 0.2, 0.1});
      EventStream a({i, 0, 0, 0}), b({i, 0, 0, 0});
      TrackingTally tally;
      const auto here = plain.SampleCollision(o, d, 5, Rgb{3, 2, 1}, Rgb::Gray(1), &a, &tally);
      const Rgb sigma = Rgb{3, 2, 1} * static_cast<float>(1 / s);
      const auto there = scaled.SampleCollision(o * s, d, 5 * s, sigma, Rgb::Gray(1), &b, &tally);
      ASSERT_EQ(here.collides, there.collides);
      ASSERT_EQ(here.weight, there.weight);
      ASSERT_EQ(here.t * s, there.t);
      ASSERT_EQ(plain.Transmittance(o, d, 5, Rgb{3, 2, 1}, &a, &tally),
                scaled.Transmittance(o * s, d, 5 * s, sigma, &b, &tally));
      ASSERT_EQ(tally.violation_count, 0u);
      collision_count += here.collides;
    }
  }
  EXPECT_GT(collision_count, 100);
}

TEST(HeterogeneousMediumTest, DensityIsInMediumSpace) {
  const auto medium = HeterogeneousMedium::FromGrid(
      "a", Wedge(), {.render_from_medium = {{0, 2, 0}, {-2, 0, 0}, {0, 0, 2}, {10, 0, 0}}});
  ASSERT_TRUE(medium.ok());
  // Along the medium's x axis, which is the render space's y axis: a linear ramp.
  for (const double x : {0.1, 0.5, 0.9}) {
    EXPECT_NEAR(medium->DensityAt({10 - 1, 2 * x, 1}), 2 * (x - 0.025), 1e-6);
  }
  EXPECT_EQ(medium->DensityAt({0, 0, 0}), 0);
}

// Where the density is linear the guess is the optical depth itself, up to four free paths at the
// largest density.
TEST(HeterogeneousMediumTest, GuessedDepthIsThatOfALinearDensity) {
  const auto medium = HeterogeneousMedium::FromGrid(
      "a", Wedge(), {.render_from_medium = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {}}});
  ASSERT_TRUE(medium.ok());
  const Vec3d o{0.2, 0.5, 0.5}, d{1, 0, 0};
  const double there = medium->DensityAt(o + 0.05 * d);
  for (const double t_max : {0.02, 0.1, 0.4}) {
    const double mean = medium->DensityAt(o + 0.5 * t_max * d);
    EXPECT_NEAR(medium->GuessDepth(o, d, t_max, 3), 3 * t_max * mean, 1e-6) << t_max;
  }
  // The largest density is 1.9.
  EXPECT_NEAR(medium->GuessDepth(o, d, 10, 40 / 1.9), 40 / 1.9 * 0.1 * there, 1e-5);
  EXPECT_EQ(medium->GuessDepth(o, d, 1, 0), 0);
}

TEST(HeterogeneousMediumTest, InvalidDensitiesAreRefused) {
  const std::vector<float> negative(8, -1.0f);
  const auto medium = HeterogeneousMedium::FromGrid(
      "a.pbrt:3:1", *VolumeGridFromArray("a", "density", {{2, 2, 2}, {}, {1, 1, 1}}, negative), {});
  EXPECT_THAT(std::string(medium.status().message()),
              ::testing::HasSubstr("a.pbrt:3:1: grid \"density\" holds negative densities"));
  const auto flat = HeterogeneousMedium::FromGrid(
      "a.pbrt:3:1", Wedge(), {.render_from_medium = {{1, 0, 0}, {0, 1, 0}, {}, {}}});
  EXPECT_THAT(std::string(flat.status().message()), ::testing::HasSubstr("singular"));
}

// Compares tracking through the cloud with quadrature.
TEST(HeterogeneousMediumTest, CloudTransmittanceMatchesQuadrature) {
  const CloudDensity cloud({.density = 1, .frequency = 3});
  const auto medium =
      HeterogeneousMedium::FromCloud("a", cloud, {.render_from_medium = {}, .extinction_max = 5});
  ASSERT_TRUE(medium.ok());
  const Vec3d o{-0.2, 0.62, 0.45}, d = Normalize(Vec3d{1, 0.05, 0.1});
  double depth = 0;
  constexpr int kSteps = 20000;
  for (int i = 0; i < kSteps; ++i) depth += medium->DensityAt(o + (i + 0.5) * 2.0 / kSteps * d);
  depth *= 2.0 / kSteps;
  ASSERT_GT(depth, 0.05);
  double sum = 0, squares = 0;
  constexpr uint32_t kWalks = 20000;
  TrackingTally tally;
  for (uint32_t i = 0; i < kWalks; ++i) {
    EventStream stream({i, 1, 0, 0});
    const double v = medium->Transmittance(o, d, 2, Rgb::Gray(5), &stream, &tally).g;
    sum += v;
    squares += v * v;
  }
  const double mean = sum / kWalks;
  const double error = std::sqrt((squares / kWalks - mean * mean) / kWalks);
  EXPECT_NEAR(mean, std::exp(-5 * depth), 4.5 * error + 1e-4);
  EXPECT_LT(error, 0.01);
  EXPECT_EQ(tally.violation_count, 0u);
}

}  // namespace
}  // namespace sheaf::render
