// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tests the hair BSDF's sampler against its pdf, across the fiber, along it and at its edges.
#include <array>
#include <optional>

#include "gtest/gtest.h"
#include "tests/support/bsdf_fixtures.h"
#include "tests/support/chi_square.h"

namespace sheaf::render {
namespace {

using sheaf::testing::BsdfFixture;
using sheaf::testing::ChiSquareResult;
using sheaf::testing::MakeHairFixture;

constexpr uint64_t kHairSampleCount = 1000000;
constexpr double kHairSignificance = 0.01;  // For the whole file.
constexpr int kHairTestCount = 24;          // At least the number of chi-square tests in this file.

void ExpectHairSamplerMatchesPdf(const BsdfFixture& hair, Vec3f wo) {
  const auto sample = [&](std::array<float, 3> u) -> std::optional<Vec3f> {
    const auto s = SampleBsdf<kAllTraits>(hair.bsdf, wo, u[0], {u[1], u[2]});
    if (!s) return std::nullopt;
    return s->wi;
  };
  const auto pdf = [&](Vec3f wi) -> double { return EvalBsdf<kAllTraits>(hair.bsdf, wo, wi).pdf; };
  const ChiSquareResult result = sheaf::testing::ChiSquareTest(sample, pdf, {}, kHairSampleCount);
  EXPECT_GE(result.p_value, sheaf::testing::SidakThreshold(kHairSignificance, kHairTestCount))
      << hair.name << ", wo.x " << wo.x << ": " << result.text;
  EXPECT_NEAR(result.pdf_integral, 1, 1e-3) << hair.name << ", wo.x " << wo.x << result.text;
}

Vec3f Across(float x) { return Normalize(Vec3f{x, 0.3f, 1}); }

TEST(HairChiSquareTest, AllRoughnesses) {
  for (float beta_m : {0.1f, 0.3f, 1.0f}) {
    for (float beta_n : {0.1f, 0.3f, 1.0f}) {
      ExpectHairSamplerMatchesPdf(MakeHairFixture(beta_m, beta_n, 0.35f, {0.1f, 0.5f, 1}),
                                  Across(0.4f));
    }
  }
}

TEST(HairChiSquareTest, EdgesAndMiddle) {
  for (float h : {-1.0f, -0.95f, 0.0f, 1.0f}) {
    ExpectHairSamplerMatchesPdf(MakeHairFixture(0.3f, 0.3f, h, {}), Across(-0.2f));
  }
}

TEST(HairChiSquareTest, AlongTheFiber) {
  for (float x : {2.0f, -10.0f, 300.0f}) {
    ExpectHairSamplerMatchesPdf(MakeHairFixture(0.3f, 0.4f, 0.5f, Rgb::Gray(0.2f)), Across(x));
  }
}

TEST(HairChiSquareTest, IndicesAndScales) {
  for (float eta : {1.0f, 1.2f, 2.0f}) {
    ExpectHairSamplerMatchesPdf(MakeHairFixture(0.25f, 0.4f, -0.6f, {}, eta, 8), Across(0.8f));
  }
}

}  // namespace
}  // namespace sheaf::render
