// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/math/perlin_noise.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <utility>

#include "common/math/mix_bits.h"
#include "gtest/gtest.h"

namespace sheaf {
namespace {

struct Moments {
  double mean = 0, square = 0, magnitude = 0;
};
// Over random places of a period.
template <typename Noise>
Moments MomentsOf(const Noise& noise) {
  constexpr int kCount = 200000;
  Moments m;
  uint64_t state = 1;
  for (int i = 0; i < kCount; ++i) {
    state = MixBits(state + 0x9e3779b97f4a7c15u);
    const auto coordinate = [&](int shift) {
      return static_cast<double>((state >> shift) & 0xfffff) * 0x1p-12;
    };
    const double value = noise(Vec3d{coordinate(0), coordinate(20), coordinate(40)});
    m.mean += value / kCount;
    m.square += value * value / kCount;
    m.magnitude += std::fabs(value) / kCount;
  }
  return m;
}

// Along one axis, a corner's gradient g at distance t counts w(t) (g t), where w(t) = Fade(1 -
// |t|).
double Window(double t) {
  const double u = 1 - std::fabs(t);
  return u * u * u * (u * (u * 6 - 15) + 10);
}
template <typename Function>
double Integral(const Function& f) {
  constexpr int kSteps = 2000;
  double sum = 0;
  for (int i = 0; i < kSteps; ++i) sum += f((i + 0.5) / kSteps);
  return sum / kSteps;
}
const double kWindowSquare = Integral([](double t) { return Window(t) * Window(t); });
const double kMomentSquare = Integral([](double t) { return t * t * Window(t) * Window(t); });
// The means of squares of a gradient's components: of 16 hashes, 10, 12 and 10 have one of +-1.
constexpr double kGradientX = 10.0 / 16, kGradientY = 12.0 / 16, kGradientZ = 10.0 / 16;
// The square of the gradients' mean, (0, 1/8, -1/8).
constexpr double kMeanGradientSquare = 2.0 / 64;

// Values of an implementation of its own, in tests/features/noise_forms.py.
TEST(PerlinNoiseTest, HasTheValuesOfTheReference) {
  EXPECT_EQ(PerlinNoise({0.5, 0.5, 0.5}), -0.125);
  EXPECT_NEAR(PerlinNoise({1.3, 2.7, -0.4}), -0.11022378246927375, 1e-13);
  EXPECT_NEAR(FractalNoise({1.3, 2.7, -0.4}, 8, 0.5), -0.033653358937204295, 1e-13);
}

TEST(PerlinNoiseTest, VanishesOnTheLatticeWithTheSlopeOfItsGradient) {
  for (int i = -300; i < 300; i += 7) {
    const Vec3d p{double(i), double(3 * i + 1), double(-2 * i)};
    EXPECT_EQ(PerlinNoise(p), 0);
    constexpr double kStep = 0x1p-20;
    int along = 0;
    for (const Vec3d d : {Vec3d{kStep, 0, 0}, Vec3d{0, kStep, 0}, Vec3d{0, 0, kStep}}) {
      const double slope = (PerlinNoise(p + d) - PerlinNoise(p - d)) / (2 * kStep);
      EXPECT_NEAR(std::fabs(slope), std::round(std::fabs(slope)), 1e-9);
      along += std::fabs(slope) > 0.5;
    }
    EXPECT_EQ(along, 2);  // Gradients point to the centers of edges.
  }
}

TEST(PerlinNoiseTest, RepeatsAfter256Units) {
  for (int i = 0; i < 100; ++i) {
    const Vec3d p{i * 1.37 - 50, i * 0.71, i * -2.9};
    const Vec3d q = p + Vec3d{256, -512, 1024};
    EXPECT_NEAR(PerlinNoise(p), PerlinNoise(q), 1e-12);
  }
}

TEST(PerlinNoiseTest, BadAndHugeCoordinatesGiveNumbers) {
  const double inf = std::numeric_limits<double>::infinity();
  for (const double bad : {inf, -inf, std::nan(""), 1e300, -1e300, -1e-300, 0x1p60, 5e-324}) {
    for (const Vec3d p : {Vec3d{bad, 0.5, 0.5}, Vec3d{0.5, bad, 0.5}, Vec3d{bad, bad, bad}}) {
      EXPECT_LE(std::fabs(PerlinNoise(p)), 1) << bad;
      EXPECT_LE(std::fabs(FractalNoise(p, 32, 0.5)), 2) << bad;
    }
  }
}

// Corners add their variances: independent gradients, of which the common mean counts little.
TEST(PerlinNoiseTest, HasTheMomentsOfIndependentGradients) {
  const Moments m = MomentsOf(PerlinNoise);
  const double gradients = kGradientX + kGradientY + kGradientZ - kMeanGradientSquare;
  EXPECT_NEAR(m.mean, 0, 0.003);
  EXPECT_NEAR(m.square, 8 * gradients * kMomentSquare * kWindowSquare * kWindowSquare,
              0.015 * m.square);
}

// Octaves are uncorrelated; their absolute values add their means.
TEST(PerlinNoiseTest, OctavesAddTheirMoments) {
  constexpr int kOctaves = 5;
  constexpr double kRoughness = 0.6;
  const Moments one = MomentsOf(PerlinNoise);
  const Moments sum = MomentsOf([](Vec3d p) { return FractalNoise(p, kOctaves, kRoughness); });
  const Moments turbulent =
      MomentsOf([](Vec3d p) { return TurbulentNoise(p, kOctaves, kRoughness); });
  double variance = 0, mean = 0;
  for (int i = 0; i < kOctaves; ++i) {
    variance += one.square * std::pow(kRoughness, 2 * i);
    mean += one.magnitude * std::pow(kRoughness, i);
  }
  EXPECT_NEAR(sum.mean, 0, 0.005);
  EXPECT_NEAR(sum.square, variance, 0.02 * variance);
  EXPECT_NEAR(turbulent.mean, mean, 0.01 * mean);
}

// Along a line the noise is a sum of windows at the integers with independent factors, so that its
// power at a frequency is that of the windows' Fourier transforms.
double ExpectedPower(double frequency) {
  const double omega = 2 * std::numbers::pi * frequency;
  const double even = 2 * Integral([&](double t) { return Window(t) * std::cos(omega * t); });
  const double odd = 2 * Integral([&](double t) { return t * Window(t) * std::sin(omega * t); });
  const double square = 2 * kWindowSquare, moment = 2 * kMomentSquare;
  return kGradientX * square * square * odd * odd +
         (kGradientY + kGradientZ) * moment * square * even * even;
}
// From lines of a period, which have `cycles` periods of the wave.
double PowerAt(int cycles) {
  constexpr int kSteps = 1024, kLines = 128, kPeriod = 256;
  double power = 0;
  for (int line = 0; line < kLines; ++line) {
    const double y = line * 158.216, z = line * 193.248;
    double re = 0, im = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double x = static_cast<double>(i) * kPeriod / kSteps;
      const double value = PerlinNoise({x, y, z}),
                   phase = 2 * std::numbers::pi * cycles * i / kSteps;
      re += value * std::cos(phase);
      im += value * std::sin(phase);
    }
    power += re * re + im * im;
  }
  return power * kPeriod / (static_cast<double>(kSteps) * kSteps * kLines);
}

TEST(PerlinNoiseTest, HasTheSpectrumOfItsWindows) {
  for (const auto& [first, last] : {std::pair{0.125, 0.5}, std::pair{0.5, 1.0}}) {
    double power = 0, expected = 0;
    for (int cycles = static_cast<int>(first * 256); cycles < last * 256; cycles += 5) {
      power += PowerAt(cycles);
      expected += ExpectedPower(cycles / 256.0);
    }
    EXPECT_NEAR(power, expected, 0.08 * expected) << first;
  }
}

// The bits are part of what an image is.
TEST(PerlinNoiseTest, KeepsItsBits) {
  uint64_t hash = 0;
  for (int i = 0; i < 1000; ++i) {
    const Vec3d p{i * 0.377 - 130, i * 1.21, i * -0.55};
    hash = MixBits(hash ^ std::bit_cast<uint64_t>(FractalNoise(p, 8, 0.5)));
    hash = MixBits(hash ^ std::bit_cast<uint64_t>(TurbulentNoise(p, 3, 0.7)));
  }
  EXPECT_EQ(hash, 12467349914015677246u);
}

}  // namespace
}  // namespace sheaf
