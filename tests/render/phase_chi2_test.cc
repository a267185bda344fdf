// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests phase functions and distance samples in media against their densities (M11, V1, V2).
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/chi_square.h"
#include "tests/support/hard_case.h"
#include "tests/support/naive_materials.h"
#include "tests/support/naive_media.h"
#include "worker/render/medium/distance_sampling.h"
#include "worker/render/medium/phase_function.h"

namespace sheaf::render {
namespace {

using sheaf::testing::ChiSquareResult;
using sheaf::testing::CounterUniforms;

constexpr double kSignificance = 0.01;  // For the whole file.
constexpr int kTestCount = 48;          // At least the number of tests in this file.
constexpr uint64_t kSampleCount = 1000000;

double Threshold() { return sheaf::testing::SidakThreshold(kSignificance, kTestCount); }

TEST(PhaseChiSquareTest, SamplesFollowTheDensity) {
  for (const float g : {-0.95f, -0.5f, -1e-4f, 0.0f, 1e-7f, 1e-3f, 0.3f, 0.8f, 0.95f}) {
    for (const Vec3f d : {Vec3f{0, 0, 1}, Normalize(Vec3f{1, -2, 0.5f})}) {
      const ChiSquareResult result = sheaf::testing::ChiSquareTest(
          [&](std::array<float, 3> u) -> std::optional<Vec3f> {
            return SampleHenyeyGreenstein(g, d, {u[0], u[1]}).w;
          },
          [&](Vec3f w) -> double { return HenyeyGreenstein(g, d, w); }, {}, kSampleCount);
      EXPECT_GE(result.p_value, Threshold()) << "g " << g << ": " << result.text;
      EXPECT_NEAR(result.pdf_integral, 1, 1e-3) << "g " << g;
    }
  }
}

// M11: narrow peaks, in one dimension. The angular distance from the peak that contains a fraction
// u of the light has a closed form; samples are uniform in u, and the mean cosine is g.
TEST(PhaseChiSquareTest, M11NarrowPeaksHaveTheirMeanCosine) {
  constexpr int kDraws = 200000;
  for (const float g : {-0.999f, -0.99f, 0.0f, 0.5f, 0.99f, 0.999f}) {
    double sum = 0, squares = 0, density = 0;
    for (int i = 0; i < kDraws; ++i) {
      const std::array<float, 3> u = CounterUniforms(7, static_cast<uint64_t>(i));
      const Vec3f d = Normalize(Vec3f{0.3f, 0.4f, -0.6f});
      const PhaseDirection sample = SampleHenyeyGreenstein(g, d, {u[0], u[1]});
      const double cosine = Dot(ToDouble(sample.w), ToDouble(d)) / Length(ToDouble(d));
      sum += cosine;
      squares += cosine * cosine;
      EXPECT_NEAR(Length(sample.w), 1, 1e-6);
      // The sample's pdf against that of its rounded direction.
      density = std::max(
          density,
          static_cast<double>(std::fabs(HenyeyGreenstein(g, d, sample.w) / sample.pdf - 1)));
    }
    const double mean = sum / kDraws;
    const double error = std::sqrt((squares / kDraws - mean * mean) / kDraws);
    EXPECT_NEAR(mean, g, 5 * error + 1e-6) << "g " << g;
    if (g == 0) {
      ExpectHardCase({.row = "M11",
                      .figure = "mean cosine at g = 0",
                      .expected = 0,
                      .measured = mean,
                      .standard_error = error,
                      .tolerance = 1e-6,
                      .naive = naive::HenyeyGreensteinCosine(0, 0.25f),
                      .naive_by = "the cosine over 2 g, at u = 1/4"});
    }
    EXPECT_LT(density, 2e-3) << "g " << g;
  }
}

// A million even steps of the cosine: the function integrates to 1 up to |g| = 0.999.
TEST(PhaseChiSquareTest, M11PhaseFunctionIntegratesToOne) {
  for (const float g : {-0.999f, -0.9f, 0.0f, 1e-6f, 0.9f, 0.999f}) {
    // Substituting e^s for the distance from the peak spreads the peak over the steps.
    constexpr int kSteps = 100000;
    const double first = std::log(1e-12), last = std::log(2.0);
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double x = std::exp(first + (last - first) * (i + 0.5) / kSteps);
      sum += 2 * kPi * static_cast<double>(HenyeyGreenstein(g, static_cast<float>(x))) * x;
    }
    EXPECT_NEAR(sum * (last - first) / kSteps, 1, 1e-4) << "g " << g;
  }
}

TEST(PhaseChiSquareTest, MixturesFollowTheirDensity) {
  PhaseMixture<Rgb> mixture;
  mixture.Add(-0.6f, {0.2f, 0.3f, 0.1f}, 0.25f);
  mixture.Add(0.0f, {0.3f, 0.1f, 0.1f}, 0.15f);
  mixture.Add(0.8f, {0.5f, 0.6f, 0.8f}, 0.6f);
  const Vec3f d = Normalize(Vec3f{-1, 0.2f, 0.4f});
  const ChiSquareResult result = sheaf::testing::ChiSquareTest(
      [&](std::array<float, 3> u) -> std::optional<Vec3f> {
        return mixture.SampleDirection(d, u[2], {u[0], u[1]}).w;
      },
      [&](Vec3f w) -> double { return mixture.Eval(d, w).pdf; }, {}, kSampleCount);
  EXPECT_GE(result.p_value, Threshold()) << result.text;
  for (int i = 0; i < 100; ++i) {
    const std::array<float, 3> u = CounterUniforms(3, static_cast<uint64_t>(i));
    const PhaseMixture<Rgb>::Sample sample = mixture.SampleDirection(d, u[2], {u[0], u[1]});
    const PhaseMixture<Rgb>::Value value = mixture.Eval(d, sample.w);
    for (size_t c = 0; c < 3; ++c) {
      EXPECT_NEAR(sample.weight[c] * value.pdf, value.f[c], 1e-5f * value.pdf);
    }
  }
}

MediumProperties<Rgb> MakeProperties(Rgb sigma_a, Rgb sigma_s) {
  MediumProperties<Rgb> mixture;
  mixture.sigma_t = sigma_a + sigma_s;
  mixture.sigma_s = sigma_s;
  mixture.scatters = !sigma_s.IsBlack();
  mixture.is_gray = mixture.sigma_t.r == mixture.sigma_t.g &&
                    mixture.sigma_t.g == mixture.sigma_t.b && sigma_s.r == sigma_s.g &&
                    sigma_s.g == sigma_s.b;
  return mixture;
}
DistanceUniforms Numbers(uint64_t seed, uint64_t i) {
  const std::array<float, 3> u = CounterUniforms(seed, 2 * i);
  return {static_cast<double>(u[0]) + 0x1p-24 * static_cast<double>(u[1]), u[2]};
}

// Distance samples end in one of 32 intervals of equal probability, or reach the end.
TEST(DistanceChiSquareTest, DistancesFollowTheDensity) {
  constexpr size_t kParts = 32;
  constexpr int kDraws = 320000;
  for (const double thickness : {1e-3, 1.0, 20.0, 1e6}) {
    const float sigma = 3;
    const double length = thickness / static_cast<double>(sigma);
    const double scattered = -std::expm1(-thickness);
    std::vector<double> counts(kParts + 1, 0), expected(kParts, kDraws * scattered / kParts);
    expected.push_back(kDraws * (1 - scattered));
    for (int i = 0; i < kDraws; ++i) {
      const DistanceSample<Rgb> distance_sample =
          SampleDistance<true>(MakeProperties(Rgb::Gray(1), Rgb::Gray(2)), length,
                               Numbers(11, static_cast<uint64_t>(i)), Rgb::Gray(1));
      if (!distance_sample.scatters) {
        counts[kParts] += 1;
        EXPECT_EQ(distance_sample.weight, Rgb::Gray(1));
        continue;
      }
      EXPECT_EQ(distance_sample.weight, Rgb::Gray(2.0f / 3));
      const double before =
          -std::expm1(-static_cast<double>(sigma) * distance_sample.distance) / scattered;
      counts[std::min(kParts - 1, static_cast<size_t>(before * kParts))] += 1;
    }
    double statistic = 0, degrees = -1;
    for (size_t i = 0; i <= kParts; ++i) {
      if (expected[i] < 5) continue;
      statistic += (counts[i] - expected[i]) * (counts[i] - expected[i]) / expected[i];
      degrees += 1;
    }
    EXPECT_GE(sheaf::testing::UpperGammaQ(degrees / 2, statistic / 2), Threshold()) << thickness;
  }
}

// V2: the scattering probability of a distance sample in a thin medium, found by bisection of its
// random number, is 1 - e^-tau to a part in a million down to 1e-8.
TEST(DistanceSamplingStability, V2ThinMediaScatterWithTheRightProbability) {
  for (double tau = 1e-8; tau < 30; tau *= 10) {
    const MediumProperties<Rgb> mixture = MakeProperties({}, Rgb::Gray(1));
    double low = 0, high = 1;
    for (int i = 0; i < 80; ++i) {
      const double u = (low + high) / 2;
      (SampleDistance<false>(mixture, tau, {u, 0}, Rgb::Gray(1)).scatters ? low : high) = u;
    }
    EXPECT_NEAR(low / -std::expm1(-tau), 1, 1e-6) << tau;
    if (tau == 1e-8) {
      ExpectHardCase({.row = "V2",
                      .figure = "chance to scatter at a thickness of 1e-8",
                      .expected = -std::expm1(-tau),
                      .measured = low,
                      .tolerance = 1e-6 * tau,
                      .naive = naive::Taken(1e-8f),
                      .naive_by = "1 - e^-tau"});
    }
    EXPECT_NEAR(TransmittanceOf<false>(mixture, tau).r, std::exp(-tau), 1e-7 * std::exp(-tau));
  }
  // The resolution of the random numbers is finer than 1e-8: steps of 2^-48.
  EXPECT_EQ(MakeDistanceUniforms({0, 0x1p-24f, 0, 0}, 0).distance, 0x1p-48);
}

// V1, V6, V11: expected values of the weights, for every pair of component and thickness; all
// weights are finite at any length, including an infinite one.
TEST(DistanceSamplingStability, V11WeightsKeepTheirExpectation) {
  constexpr int kDraws = 400000;
  const Rgb sigma_s{1, 10, 100}, sigma_a{0.5f, 0, 25};
  const MediumProperties<Rgb> mixture = MakeProperties(sigma_a, sigma_s);
  for (const double length : {1e-4, 0.01, 0.3, 5.0, HUGE_VAL}) {
    std::array<double, 3> arrived{}, arrived_squares{}, scattered{}, scattered_squares{};
    const Rgb carried{0.2f, 1, 3};
    for (int i = 0; i < kDraws; ++i) {
      const DistanceSample<Rgb> distance_sample =
          SampleDistance<true>(mixture, length, Numbers(5, static_cast<uint64_t>(i)), carried);
      ASSERT_TRUE(IsFinite(distance_sample.weight)) << length;
      for (size_t c = 0; c < 3; ++c) {
        const double w = static_cast<double>(distance_sample.weight[c]);
        (distance_sample.scatters ? scattered : arrived)[c] += w;
        (distance_sample.scatters ? scattered_squares : arrived_squares)[c] += w * w;
      }
    }
    for (size_t c = 0; c < 3; ++c) {
      const double sigma = static_cast<double>(mixture.sigma_t[c]);
      const double left = std::exp(-sigma * length);
      const double albedo = static_cast<double>(sigma_s[c]) / sigma;
      const auto expect = [&](double sum, double squares, double expected) {
        const double mean = sum / kDraws;
        const double error =
            std::sqrt(std::max(0.0, squares / kDraws - mean * mean) / kDraws) + 1e-7;
        EXPECT_NEAR(mean, expected, 5 * error) << "length " << length << ", component " << c;
      };
      expect(arrived[c], arrived_squares[c], left);
      expect(scattered[c], scattered_squares[c], albedo * (1 - left));
    }
  }
}

TEST(DistanceSamplingStability, V6InfiniteMediaAbsorbAndVacuumTransmits) {
  EXPECT_EQ(TransmittanceOf<true>(MakeProperties({1, 0, 1e-30f}, {}), HUGE_VAL), (Rgb{0, 1, 0}));
  ExpectHardCase({.row = "V6",
                  .figure = "transmittance of endless vacuum",
                  .expected = 1,
                  .measured = TransmittanceOf<false>(MakeProperties({}, {}), HUGE_VAL).g,
                  .naive = naive::Transmittance(0, HUGE_VALF),
                  .naive_by = "e^-(sigma t)"});
  const DistanceSample<Rgb> distance_sample =
      SampleDistance<true>(MakeProperties({}, {1, 0, 0}), HUGE_VAL, {0.5, 0.99f}, {1, 1, 1});
  EXPECT_TRUE(IsFinite(distance_sample.weight));
  MediumProperties<Rgb> emissive = MakeProperties({2, 0, 1e-20f}, {});
  emissive.emission = {6, 0, 1e-20f};
  const Rgb light = EmissionAlong(emissive, HUGE_VAL);
  EXPECT_FLOAT_EQ(light.r, 3);
  EXPECT_EQ(light.g, 0);
  EXPECT_FLOAT_EQ(light.b, 1);
  EXPECT_FLOAT_EQ(EmissionAlong(emissive, 1e-9).r, 6e-9f);
}

// One point represents all emission along a length: its mean is correct, and no sample exceeds the
// mean by a factor of more than the number of components, however different these are.
TEST(DistanceSamplingStability, V10EmissionSamplesHaveBoundedWeights) {
  constexpr int kSide = 300;
  MediumProperties<Rgb> emissive = MakeProperties({1e-3f, 1, 1e3f}, {});
  for (const Rgb emission : {Rgb{1e-3f, 2, 5e2f}, Rgb{0, 2, 5e2f}, Rgb{0, 0, 1}}) {
    emissive.emission = emission;
    for (const double length : {1e-8, 0.1, 50.0, 1e6, HUGE_VAL}) {
      const Rgb expected = EmissionAlong(emissive, length);
      std::array<double, 3> sum{}, most{};
      for (int i = 0; i < kSide * kSide; ++i) {
        const EmissionSample point =
            SampleEmission(emissive, length, (i / kSide + 0.5) / kSide,  // NOLINT
                           (i % kSide + 0.5) / kSide);
        ASSERT_GE(point.distance, 0);
        ASSERT_LE(point.distance, length);
        const Rgb worth = emission * TransmittanceOf<true>(emissive, point.distance) *
                          static_cast<float>(1 / point.pdf);
        for (size_t c = 0; c < 3; ++c) {
          sum[c] += worth[c];
          most[c] = std::max(most[c], static_cast<double>(worth[c]));
        }
      }
      for (size_t c = 0; c < 3; ++c) {
        EXPECT_NEAR(sum[c] / (kSide * kSide), expected[c], 5e-3 * expected[c]) << length << c;
        EXPECT_LE(most[c], 3.0001 * expected[c]) << length << c;
      }
    }
  }
}

}  // namespace
}  // namespace sheaf::render
