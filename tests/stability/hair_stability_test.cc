// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The hard cases of hair: M12 (small roughness), the edges of the fiber, light along it, indices
// close to 1. Expected values are closed forms or high-precision quadrature in double.
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <tuple>
#include <vector>

#include "gtest/gtest.h"
#include "tests/support/bsdf_fixtures.h"
#include "tests/support/chi_square.h"
#include "tests/support/hard_case.h"
#include "tests/support/naive_materials.h"

namespace sheaf::render {
namespace {

using sheaf::testing::BsdfFixture;
using sheaf::testing::CounterUniforms;
using sheaf::testing::MakeHairFixture;

constexpr float kPiF = std::numbers::pi_v<float>;
constexpr double kFurnaceError = 0.005;

// At angle theta to the plane across the fiber, azimuth phi about it.
Vec3f FiberDirection(double theta, double phi) {
  return ToFloat(
      Vec3d{std::sin(theta), std::cos(theta) * std::cos(phi), std::cos(theta) * std::sin(phi)});
}

// Integral of f over the sphere by the midpoint rule in the fiber's angles, with `steps` across
// phi.
template <typename F>
double IntegrateOverSphere(F f, int steps) {
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    const double theta = std::numbers::pi * ((i + 0.5) / steps - 0.5);
    double row = 0;
    for (int j = 0; j < steps; ++j) {
      row += f(FiberDirection(theta, 2 * std::numbers::pi * (j + 0.5) / steps));
    }
    sum += row * std::cos(theta);
  }
  return sum * 2 * std::numbers::pi * std::numbers::pi / (static_cast<double>(steps) * steps);
}

// The albedo of a fiber under a constant sky, by its own sampler.
double SampledAlbedo(const Bsdf& bsdf, Vec3f wo, int draws = 4000) {
  double sum = 0;
  for (int i = 0; i < draws; ++i) {
    const auto u = CounterUniforms(5, static_cast<uint64_t>(i));
    const auto sample = SampleBsdf<kAllTraits>(bsdf, wo, u[0], {u[1], u[2]});
    if (sample) sum += sample->weight.g;
  }
  return sum / draws;
}

// The sum of the lobes' energies of a fiber, for one component.
double SumOfEnergies(const Bsdf& bsdf, Vec3f wo) {
  double sum = 0;
  for (const Rgb& energy : MakeHairPaths(bsdf, wo).energy) sum += static_cast<double>(energy.g);
  return sum;
}

TEST(HairStability, M12_WhiteFurnaceByQuadrature) {
  for (float beta_m : {0.1f, 0.3f, 0.7f, 1.0f}) {
    for (float beta_n : {0.1f, 0.5f, 1.0f}) {
      for (float eta : {1.1f, 1.55f, 2.5f}) {
        for (double theta : {0.0, -1.2}) {
          const BsdfFixture hair = MakeHairFixture(beta_m, beta_n, 0.4f, {}, eta);
          const Vec3f wo = FiberDirection(theta, 0.7);
          double pdf = 0;
          const double albedo = IntegrateOverSphere(
              [&](Vec3f wi) {
                const BsdfValue value = EvalBsdf<kAllTraits>(hair.bsdf, wo, wi);
                pdf += static_cast<double>(value.pdf * std::sqrt(wi.y * wi.y + wi.z * wi.z));
                return static_cast<double>(value.f_cos.g);
              },
              200);
          EXPECT_NEAR(albedo, 1, kFurnaceError) << hair.name << " theta " << theta;
          EXPECT_NEAR(pdf * 2 * std::numbers::pi * std::numbers::pi / 40000, 1, kFurnaceError)
              << hair.name << " theta " << theta;
        }
      }
    }
  }
}

TEST(HairStability, M12_WhiteFurnaceBySampling) {
  for (float beta : {0.01f, 0.1f, 0.3f, 1.0f}) {
    for (float eta : {1.0f, 1.3f, 1.55f, 2.0f}) {
      for (float h : {-1.0f, -0.9999f, -0.5f, 0.0f, 0.99f, 1.0f}) {
        const BsdfFixture hair = MakeHairFixture(beta, beta, h, {}, eta);
        for (double theta : {0.0, 0.8, -1.5, 1.57}) {
          EXPECT_NEAR(SampledAlbedo(hair.bsdf, FiberDirection(theta, 2), 200), 1, 1e-3)
              << hair.name << " theta " << theta;
        }
      }
    }
  }
}

// e^-x I0(x) to 1e-16 by the power series, or its asymptotic one.
double ScaledBesselReference(double x) {
  double sum = 1, term = 1;
  if (x < 30) {
    for (int k = 1; k < 200; ++k) sum += term *= x * x / (4.0 * k * k);
    return sum * std::exp(-x);
  }
  for (int k = 1; k < 12; ++k) sum += term *= (2.0 * k - 1) * (2 * k - 1) / (8 * k * x);
  return sum / std::sqrt(2 * std::numbers::pi * x);
}

TEST(HairStability, M12_BesselFunctionStaysBounded) {
  for (double x : {0.0, 1e-6, 0.5, 1.0, 3.7499, 3.75, 5.0, 12.0, 30.0, 1e3, 7e4, 1e8}) {
    const double expected = ScaledBesselReference(x);
    EXPECT_NEAR(ScaledBesselI0(static_cast<float>(x)), expected, 6e-7 * expected) << x;
  }
  EXPECT_TRUE(std::isfinite(ScaledBesselI0(1e38f)) && ScaledBesselI0(1e38f) > 0);
}

// The lobe along the fiber, against its own formula in long double where that is accurate, and its
// integral, down to variances whose exponents (1 / v) overflow.
TEST(HairStability, M12_LongitudinalLobesStayNormalized) {
  for (float beta : {0.01f, 0.02f, 0.05f, 0.1f, 0.5f, 1.0f}) {
    for (double theta_o : {0.0, 0.7, 1.5, -1.57}) {
      for (float ratio : {0.25f, 1.0f, 4.0f}) {
        const FiberLobe lobe{static_cast<float>(std::sin(theta_o)),
                             static_cast<float>(std::cos(theta_o)), ratio * HairVariance(beta), 0};
        constexpr int kSteps = 400000;
        double sum = 0;
        for (int i = 0; i < kSteps; ++i) {
          const double theta = std::numbers::pi * ((i + 0.5) / kSteps - 0.5);
          sum += static_cast<double>(lobe.AlongPdf(static_cast<float>(std::sin(theta)),
                                                   static_cast<float>(std::cos(theta)))) *
                 std::cos(theta);
        }
        // In float, directions within 1e-3 of the fiber's direction have few digits of their
        // cosine.
        EXPECT_NEAR(sum * std::numbers::pi / kSteps, 1, 1e-3)
            << "beta " << beta << " theta " << theta_o << " ratio " << ratio;
        if (beta > 0.01f || theta_o != 0 || ratio != 1) continue;
        ExpectHardCase({.row = "M12",
                        .figure = "integral of the lobe along a fiber of roughness 0.01",
                        .expected = 1,
                        .measured = sum * std::numbers::pi / kSteps,
                        .tolerance = 1e-3,
                        .naive = naive::HairLobe(HairVariance(beta), 0, 1),
                        .naive_by = "exp, I0 and sinh multiplied, at the peak"});
      }
    }
  }
}

TEST(HairStability, M12_LongitudinalLobesMatchTheirFormula) {
  for (double v : {0.2, 1.0, 30.0, 110.0}) {
    for (double a : {0.0, 0.5, -1.3}) {
      for (double b : {0.1, -0.6, 1.4}) {
        const double x = std::cos(a) * std::cos(b) / v;
        const double expected = std::exp(-std::sin(a) * std::sin(b) / v) *
                                ScaledBesselReference(x) * std::exp(x) / (2 * v * std::sinh(1 / v));
        const FiberLobe lobe{static_cast<float>(std::sin(a)), static_cast<float>(std::cos(a)),
                             static_cast<float>(v), 0};
        EXPECT_NEAR(lobe.AlongPdf(static_cast<float>(std::sin(b)), static_cast<float>(std::cos(b))),
                    expected, 3e-6 * expected)
            << v << " " << a << " " << b;
      }
    }
  }
}

TEST(HairStability, AzimuthalLobesStayNormalized) {
  for (float beta : {0.01f, 0.1f, 0.3f, 1.0f}) {
    const float scale = HairLogisticScale(beta);
    constexpr int kSteps = 1000000;
    double sum = 0;
    for (int i = 0; i < kSteps; ++i) {
      const double x = 2 * std::numbers::pi * ((i + 0.5) / kSteps - 0.5);
      sum += static_cast<double>(TrimmedLogisticPdf(static_cast<float>(x), scale));
    }
    EXPECT_NEAR(sum * 2 * std::numbers::pi / kSteps, 1, 1e-5) << beta;
    EXPECT_EQ(SampleTrimmedLogistic(0.5f, scale), 0);
    for (float u : {0.0f, 1e-7f, 0.3f, 0x1.fffffep-1f}) {
      const float x = SampleTrimmedLogistic(u, scale);
      EXPECT_TRUE(x >= -kPiF && x <= kPiF) << beta << " " << u;
    }
    // The distribution's own quantile.
    const double mass = std::tanh(std::numbers::pi / (2 * static_cast<double>(scale)));
    EXPECT_NEAR(SampleTrimmedLogistic(0.8f, scale),
                2 * static_cast<double>(scale) * std::atanh(0.6 * mass),
                2e-6 * (1 + static_cast<double>(scale)));
  }
}

TEST(HairStability, LobeEnergiesAddUpToOne) {
  for (float eta : {0.7f, 1.0f, 1.0001f, 1.55f, 3.0f}) {
    for (float h : {-1.0f, -0.99999994f, -0.3f, 0.0f, 0.999f, 1.0f}) {
      for (double theta : {0.0, 1.0, 1.57, std::numbers::pi / 2}) {
        const BsdfFixture hair = MakeHairFixture(0.3f, 0.3f, h, {}, eta);
        EXPECT_NEAR(SumOfEnergies(hair.bsdf, FiberDirection(theta, 1)), 1, 1e-5)
            << hair.name << " theta " << theta;
      }
    }
  }
}

// Straight through the middle (h = 0, theta = 0) the series has a closed form: light hits the wall
// at normal incidence, and crosses two radii of absorbing interior between any two walls.
TEST(HairStability, AbsorptionHasItsClosedForm) {
  const float f = (0.55f / 2.55f) * (0.55f / 2.55f);
  for (float sigma : {0.1f, 1.0f, 20.0f}) {
    const Bsdf bsdf = MakeHairFixture(0.3f, 0.3f, 0, Rgb::Gray(sigma)).bsdf;
    const float t = std::exp(-2 * sigma);
    EXPECT_NEAR(SumOfEnergies(bsdf, {0, 0, 1}), f + (1 - f) * (1 - f) * t / (1 - t * f), 1e-6);
  }
  EXPECT_NEAR(SumOfEnergies(MakeHairFixture(0.3f, 0.3f, 0, Rgb::Gray(1e8f)).bsdf, {0, 0, 1}), f,
              1e-7);
}

// At the very edge all light is reflected back: Fresnel is 1, and the other lobes would divide 0 by
// 0.
TEST(HairStability, FiberEdgesReflectEverything) {
  for (float h : {-1.0f, 1.0f}) {
    for (float sigma : {0.0f, 1e8f}) {
      const BsdfFixture hair = MakeHairFixture(0.3f, 0.3f, h, Rgb::Gray(sigma));
      const HairPaths<Rgb> paths = MakeHairPaths(hair.bsdf, Vec3f{0.1f, 0, std::sqrt(0.99f)});
      EXPECT_EQ(paths.energy[0].g, 1);
      for (size_t p = 1; p < kHairLobeCount; ++p) EXPECT_EQ(paths.energy[p].g, 0);
      EXPECT_NEAR(SampledAlbedo(hair.bsdf, FiberDirection(0.1, 1)), 1, 1e-4);
    }
  }
}

TEST(HairStability, ValuesAreFiniteAlongTheFiber) {
  const Vec3f directions[] = {{1, 0, 0},
                              {-1, 0, 0},
                              {1, 1e-30f, 0},
                              {-1, 0, 1e-20f},
                              {0, 0, -1},
                              {0, 1, 0},
                              FiberDirection(1.5707, 3),
                              FiberDirection(-1.57079, -3)};
  for (float beta : {0.01f, 1.0f}) {
    for (float eta : {0.5f, 1.0f, 1.55f}) {
      for (float h : {-1.0f, 0.2f, 1.0f}) {
        const BsdfFixture hair = MakeHairFixture(beta, beta, h, {0, 1, 1e8f}, eta, 10);
        for (Vec3f wo : directions) {
          for (Vec3f wi : directions) {
            const BsdfValue value = EvalBsdf<kAllTraits>(hair.bsdf, wo, wi);
            EXPECT_TRUE(IsFinite(value.f_cos) && std::isfinite(value.pdf)) << hair.name;
            EXPECT_GE(value.pdf, 0);
          }
          for (uint64_t i = 0; i < 500; ++i) {
            const auto u = CounterUniforms(9, i);
            const auto sample = SampleBsdf<kAllTraits>(hair.bsdf, wo, u[0], {u[1], u[2]});
            if (!sample) continue;
            EXPECT_TRUE(IsFinite(sample->weight)) << hair.name;
            EXPECT_NEAR(Length(sample->wi), 1, 1e-6);
            EXPECT_EQ(sample->pdf, EvalBsdf<kAllTraits>(hair.bsdf, wo, sample->wi).pdf);
          }
        }
      }
    }
  }
}

// The ends of the unit interval are valid random numbers.
TEST(HairStability, ExtremeRandomNumbersGiveDirections) {
  const float last = 0x1.fffffep-1f;
  const BsdfFixture hair = MakeHairFixture(0.05f, 0.05f, 0.3f, Rgb::Gray(0.2f));
  for (float a : {0.0f, 0.5f, last}) {
    for (float b : {0.0f, last}) {
      for (float c : {0.0f, last}) {
        const auto sample = SampleBsdf<kAllTraits>(hair.bsdf, FiberDirection(0.4, 0.1), a, {b, c});
        if (!sample) continue;
        EXPECT_TRUE(IsFinite(sample->weight)) << a << " " << b << " " << c;
        EXPECT_NEAR(Length(sample->wi), 1, 1e-6);
      }
    }
  }
}

// Only the fiber's direction matters, not the direction of the normal.
TEST(HairStability, RotationAboutTheFiberHasNoEffect) {
  const BsdfFixture hair = MakeHairFixture(0.2f, 0.3f, 0.6f, Rgb::Gray(0.3f));
  const BsdfValue here =
      EvalBsdf<kAllTraits>(hair.bsdf, FiberDirection(0.3, 1), FiberDirection(-0.4, 2.5));
  for (double turn : {1.0, 2.5, 4.0}) {
    const BsdfValue there = EvalBsdf<kAllTraits>(hair.bsdf, FiberDirection(0.3, 1 + turn),
                                                 FiberDirection(-0.4, 2.5 + turn));
    EXPECT_NEAR(there.f_cos.g, here.f_cos.g, 1e-5f * here.f_cos.g);
    EXPECT_NEAR(there.pdf, here.pdf, 1e-5f * here.pdf);
  }
  EXPECT_GT(here.f_cos.g, 0);
}

// With zero scale angle, both ends of the fiber see the same; and the two edges are mirror images.
TEST(HairStability, MirrorImagesScatterAlike) {
  const Bsdf left = MakeHairFixture(0.3f, 0.3f, 0.5f, Rgb::Gray(0.3f), 1.55f, 0).bsdf;
  const Bsdf right = MakeHairFixture(0.3f, 0.3f, -0.5f, Rgb::Gray(0.3f), 1.55f, 0).bsdf;
  const float expected =
      EvalBsdf<kAllTraits>(left, FiberDirection(0.3, 0.2), FiberDirection(0.5, 1.4)).f_cos.g;
  EXPECT_NEAR(
      EvalBsdf<kAllTraits>(left, FiberDirection(-0.3, 0.2), FiberDirection(-0.5, 1.4)).f_cos.g,
      expected, 1e-5f * expected);
  EXPECT_NEAR(
      EvalBsdf<kAllTraits>(right, FiberDirection(0.3, -0.2), FiberDirection(0.5, -1.4)).f_cos.g,
      expected, 1e-5f * expected);
}

// Hair with this absorption reflects the requested color: the fit and its inverse.
TEST(HairStability, AbsorptionOfAReflectanceInvertsTheFit) {
  EXPECT_EQ(HairAbsorption(1, 0.3f), 0);
  const float scale = HairReflectanceScale(0.3f);
  EXPECT_NEAR(scale, 5.88841f, 1e-4);  // 5.969 - .0645 + .22788 - .28971 + .04515 + .0006.
  for (float c : {0.9f, 0.2f, 1e-3f}) {
    EXPECT_NEAR(std::exp(-std::sqrt(HairAbsorption(c, 0.3f)) * scale), c, 1e-6f);
  }
  EXPECT_TRUE(std::isfinite(HairAbsorption(0, 0.3f)));
}

}  // namespace
}  // namespace sheaf::render
