// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/math/lattice_noise.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>

#include "common/math/mix_bits.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

// Values of an implementation of its own, in tests/features/noise_forms.py.
TEST(LatticeNoiseTest, HasTheValuesOfTheReference) {
  EXPECT_EQ(HashOf(1, 2, 3), 3100736010u);
  EXPECT_NEAR(LatticeNoise(Vec3d{1.3, 2.7, -0.4}), 0.36789173791311336, 1e-14);
}

TEST(LatticeNoiseTest, HashesAreSpreadOverAllBits) {
  int ones[32] = {};
  constexpr int kKeys = 20000;
  for (uint32_t i = 0; i < kKeys; ++i) {
    const uint32_t h = HashOf(i, i / 7, 3);
    for (int b = 0; b < 32; ++b) ones[b] += static_cast<int>((h >> b) & 1);
  }
  for (const int count : ones) EXPECT_NEAR(count, kKeys / 2, 5 * std::sqrt(kKeys / 4.0));
}

TEST(LatticeNoiseTest, RandomNumbersAreUniform) {
  double sum = 0, square = 0;
  constexpr int kCount = 20000;
  for (int i = 0; i < kCount; ++i) {
    const auto x = static_cast<double>(RandomOf(static_cast<float>(i), 0.5f, -3));
    EXPECT_GE(x, 0);
    EXPECT_LE(x, 1);
    sum += x;
    square += x * x;
  }
  EXPECT_NEAR(sum / kCount, 0.5, 0.01);
  EXPECT_NEAR(square / kCount, 1.0 / 3, 0.01);
}

// As for Perlin's noise (perlin_noise_test.cc): variances of corners add. Along each axis in the
// plane, 1 or 2 squared is the gradient's component, with equal chances; in space, two of three.
TEST(LatticeNoiseTest, HasTheMomentsOfIndependentGradients) {
  constexpr int kCount = 200000;
  double plane = 0, space = 0;
  uint64_t state = 1;
  for (int i = 0; i < kCount; ++i) {
    state = MixBits(state + 0x9e3779b97f4a7c15u);
    const auto coordinate = [&](int shift) {
      return static_cast<double>((state >> shift) & 0xfffff) * 0x1p-10 - 500;
    };
    const Vec3d p{coordinate(0), coordinate(20), coordinate(40)};
    plane += std::pow(LatticeNoise(Vec2d{p.x, p.y}), 2) / kCount;
    space += std::pow(LatticeNoise(p), 2) / kCount;
  }
  // The integrals of t^2 w(t)^2 and of w(t)^2 over [0, 1].
  constexpr double kMomentSquare = 0.029692529692529696, kWindowSquare = 0.3917748917748918;
  const double expected_plane = 4 * 5 * kMomentSquare * kWindowSquare * 0.6616 * 0.6616;
  const double expected_space =
      8 * 2 * kMomentSquare * kWindowSquare * kWindowSquare * 0.9820 * 0.9820;
  EXPECT_NEAR(plane, expected_plane, 0.02 * expected_plane);
  EXPECT_NEAR(space, expected_space, 0.02 * expected_space);
}

TEST(LatticeNoiseTest, BadAndHugeCoordinatesGiveNumbers) {
  const double inf = std::numeric_limits<double>::infinity();
  for (const double bad : {inf, -inf, std::nan(""), 1e300, -0x1p31, 0x1p31, -1e-300}) {
    EXPECT_TRUE(std::isfinite(LatticeNoise(Vec3d{bad, 0.3, 0.4})));
    EXPECT_TRUE(std::isfinite(LatticeNoise(Vec2d{0.3, bad})));
  }
}

// The bits are part of what an image is.
TEST(LatticeNoiseTest, KeepsItsBits) {
  uint64_t hash = 0;
  for (int i = 0; i < 1000; ++i) {
    const Vec3d p{i * 0.377 - 130, i * 1.21, i * -0.55};
    hash = MixBits(hash ^ std::bit_cast<uint64_t>(LatticeNoise(p)));
    hash = MixBits(hash ^ std::bit_cast<uint64_t>(LatticeNoise(Vec2d{p.x, p.y})));
    hash = MixBits(hash ^ HashOf(static_cast<uint32_t>(i), 1, 2, 3));
  }
  EXPECT_EQ(hash, 15816206504434962900u);
}

}  // namespace
}  // namespace sheaf
