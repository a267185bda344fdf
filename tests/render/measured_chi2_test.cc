// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Measured materials: the warps used for sampling, the sampler against its pdf, and a file
// generated from a known function against that function.
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <numbers>
#include <optional>
#include <string>
#include <vector>

#include "common/scene/formats/measured_file.h"
#include "gtest/gtest.h"
#include "tests/support/bsdf_fixtures.h"
#include "tests/support/chi_square.h"
#include "tests/support/hard_case.h"
#include "tests/support/measured_builder.h"
#include "tests/support/temporary_path.h"
#include "worker/render/bsdf/measured_brdf.h"
#include "worker/render/sampling/warp_table.h"

namespace sheaf::render {
namespace {

using sheaf::testing::ChiSquareGrid;
using sheaf::testing::ChiSquareResult;
using sheaf::testing::CounterUniforms;
using sheaf::testing::DirectionAt;
using sheaf::testing::MeasuredFileBuilder;

constexpr uint64_t kMeasuredSampleCount = 1000000;
constexpr double kMeasuredSignificance = 0.01;  // For the whole file.
constexpr int kMeasuredTestCount = 16;  // At least the number of chi-square tests in this file.

MeasuredBrdf Make(const MeasuredFileBuilder& builder, bool spectral = false) {
  const std::string path = sheaf::testing::TemporaryPath("measured.bsdf");
  builder.Write(path);
  absl::StatusOr<MeasuredData> data = ReadMeasuredFile("test.bsdf", path);
  std::filesystem::remove(path);
  EXPECT_TRUE(data.ok()) << data.status();
  return MeasuredBrdf(*std::move(data), spectral);
}
Bsdf BsdfFor(const MeasuredBrdf& measured) {
  Bsdf bsdf = sheaf::testing::MakeBsdfOfKind(BsdfKind::kMeasured);
  bsdf.measured = &measured;
  return bsdf;
}

MeasuredFileBuilder AnisotropicBuilder() {
  MeasuredFileBuilder builder;
  builder.phi.clear();
  for (int i = 0; i <= 8; ++i) builder.phi.push_back(static_cast<float>(i - 4) * 0.7853982f);
  builder.theta = {0, 0.5f, 1.0f, 1.4f};
  builder.alpha_x = 0.2;
  builder.alpha_y = 0.6;
  // Brighter towards +x, so that a rotated frame is detected.
  builder.f_cos = [builder](Vec3d wo, Vec3d wi, double) {
    return builder.Density(Normalize(wo + wi)) / (4 * builder.Sigma(wo)) * (0.6 + 0.4 * wi.x);
  };
  return builder;
}
// A highlight brighter on one side: single scattering of GGX normals without Fresnel and shadowing,
// times a factor that depends on the wavelength.
MeasuredFileBuilder GlossyBuilder() {
  MeasuredFileBuilder builder;
  builder.alpha_x = builder.alpha_y = 0.3;
  builder.f_cos = [builder](Vec3d wo, Vec3d wi, double nm) {
    return builder.Density(Normalize(wo + wi)) / (4 * builder.Sigma(wo)) * nm / 800;
  };
  return builder;
}

TEST(WarpTableTest, PointsAndDensitiesRoundTrip) {
  std::vector<float> values(2 * 5 * 4);
  for (size_t i = 0; i < values.size(); ++i) values[i] = CounterUniforms(3, i)[0];
  for (size_t i = 0; i < 8; ++i) values[i] = 0;  // Two rows of the first slice are black.
  const WarpTable table(4, 5, values);
  for (float weight : {1.0f, 0.3f}) {
    SliceBlend blend;
    blend.count = 2;
    blend.slice = {0, 1};
    blend.weight = {weight, 1 - weight};
    for (uint64_t i = 0; i < 5000; ++i) {
      const auto u = CounterUniforms(4, i);
      const WarpTable::Point to = table.Sample(blend, {u[0], u[1]});
      ASSERT_GT(to.pdf, 0);
      const WarpTable::Point back = table.Invert(blend, to.p);
      EXPECT_NEAR(back.p.x, u[0], 2e-5);
      EXPECT_NEAR(back.p.y, u[1], 2e-5);
      EXPECT_NEAR(back.pdf, to.pdf, 1e-4f * (1 + to.pdf));
      EXPECT_EQ(back.pdf, table.Pdf(blend, to.p));
    }
    double integral = 0;
    constexpr int kSteps = 500;
    for (int i = 0; i < kSteps * kSteps; ++i) {
      integral +=
          static_cast<double>(table.Pdf(blend, {(static_cast<float>(i % kSteps) + 0.5f) / kSteps,
                                                (static_cast<float>(i / kSteps) + 0.5f) / kSteps}));
    }
    EXPECT_NEAR(integral / (kSteps * kSteps), 1, 1e-3);
  }
}

TEST(WarpTableTest, BlackIsUniformAndEndpointsAreExact) {
  const WarpTable table(2, 2, std::vector<float>(4, 0));
  SliceBlend blend;
  blend.count = 1;
  blend.weight[0] = 1;
  EXPECT_EQ(table.Sample(blend, {0.25f, 0.75f}).pdf, 1);
  EXPECT_NEAR(table.Sample(blend, {0.25f, 0.75f}).p.x, 0.25f, 1e-6);
  EXPECT_TRUE(std::isfinite(table.Invert(blend, {1, 1}).p.x));
  const std::vector<float> axis = {1, 2, 4};
  EXPECT_EQ(FindOnAxis(axis, 0).index, 0u);
  EXPECT_EQ(FindOnAxis(axis, 3).index, 1u);
  EXPECT_EQ(FindOnAxis(axis, 3).fraction, 0.5f);
  EXPECT_EQ(FindOnAxis(axis, 9).index, 2u);
  EXPECT_EQ(FindOnAxis(axis, 9).fraction, 0);
  EXPECT_EQ(FindOnAxis(axis, std::nanf("")).index, 0u);
}

void ExpectSamplerMatchesPdf(const MeasuredBrdf& measured, Vec3f wo, const std::string& name) {
  const Bsdf bsdf = BsdfFor(measured);
  const auto sample = [&](std::array<float, 3> u) {
    const auto s = SampleBsdf<kAllTraits>(bsdf, wo, u[0], {u[1], u[2]});
    return s ? std::optional<Vec3f>(s->wi) : std::nullopt;
  };
  const auto pdf = [&](Vec3f wi) -> double { return EvalBsdf<kAllTraits>(bsdf, wo, wi).pdf; };
  ChiSquareGrid grid;
  grid.cos_min = wo.z > 0 ? 0 : -1;
  grid.cos_max = wo.z > 0 ? 1 : 0;
  const ChiSquareResult result =
      sheaf::testing::ChiSquareTest(sample, pdf, grid, kMeasuredSampleCount);
  EXPECT_GE(result.p_value,
            sheaf::testing::SidakThreshold(kMeasuredSignificance, kMeasuredTestCount))
      << name << ", wo.z " << wo.z << ": " << result.text;
  EXPECT_LE(result.pdf_integral, 1 + 1e-3) << name << ", wo.z " << wo.z << ": " << result.text;
}

TEST(MeasuredChiSquareTest, IsotropicFromBothSides) {
  const MeasuredBrdf matte = Make(MeasuredFileBuilder{}), glossy = Make(GlossyBuilder());
  for (float mu : {0.95f, 0.5f, -0.3f}) {
    ExpectSamplerMatchesPdf(matte, DirectionAt(mu, 1), "matte");
    ExpectSamplerMatchesPdf(glossy, DirectionAt(mu, 4), "glossy");
  }
}

TEST(MeasuredChiSquareTest, Anisotropic) {
  const MeasuredBrdf measured = Make(AnisotropicBuilder());
  for (float mu : {0.9f, 0.4f, -0.7f}) {
    ExpectSamplerMatchesPdf(measured, DirectionAt(mu, 2.2f), "anisotropic");
  }
}

TEST(MeasuredTest, M13_SamplePdfEqualsEvaluatedPdf) {
  const MeasuredBrdf measured = Make(GlossyBuilder());
  const Bsdf bsdf = BsdfFor(measured);
  int differing = 0;
  for (float mu : {1.0f, 0.5f, 0.01f, -0.5f}) {
    const Vec3f wo = DirectionAt(mu, 1);
    for (uint64_t i = 0; i < 2000; ++i) {
      const auto u = CounterUniforms(7, i);
      const auto sample = SampleBsdf<kAllTraits>(bsdf, wo, u[0], {u[1], u[2]});
      if (!sample) continue;
      differing += sample->pdf != EvalBsdf<kAllTraits>(bsdf, wo, sample->wi).pdf;
      ASSERT_TRUE(IsFinite(sample->weight) && sample->weight.r >= 0);
    }
  }
  ExpectHardCase({.row = "M13",
                  .figure = "samples of 8000 whose pdf is not that of their direction",
                  .expected = 0,
                  .measured = differing});
}

// At measured directions of incidence, only the grid over the square is interpolated.
TEST(MeasuredTest, ReproducesTheMeasuredFunction) {
  for (const MeasuredFileBuilder& builder :
       {MeasuredFileBuilder{}, GlossyBuilder(), AnisotropicBuilder()}) {
    const MeasuredBrdf measured = Make(builder);
    for (const size_t t : {size_t{1}, size_t{2}}) {
      const float phi = builder.phi[builder.phi.size() / 3];
      const Vec3f wo = ToFloat(MeasuredFileBuilder::Direction(builder.theta[t], phi));
      double squares = 0, sum = 0;
      int count = 0;
      for (uint64_t i = 0; i < 500; ++i) {
        const auto u = CounterUniforms(2, i);
        const std::optional<Vec3f> wi = measured.Sample(wo, {u[0], u[1]});
        if (!wi || wi->z < 0.1f) continue;
        // RGB equals the value itself for gray materials, and for others the value in the middle of
        // green.
        const double expected = builder.f_cos(ToDouble(wo), ToDouble(*wi), 540);
        const double ratio =
            static_cast<double>(measured.Eval(wo, *wi, Rgb{}).f_cos.g) / expected - 1;
        sum += ratio;
        squares += ratio * ratio;
        ++count;
      }
      ASSERT_GT(count, 100);
      EXPECT_NEAR(sum / count, 0, 0.03);
      EXPECT_LT(std::sqrt(squares / count), 0.08) << builder.alpha_x << " " << t;
    }
  }
}

// A matte white material: with 17 x 17 cells it is nearly white.
TEST(MeasuredTest, WhiteFurnace) {
  MeasuredFileBuilder white;
  white.f_cos = [](Vec3d, Vec3d wi, double) { return wi.z / std::numbers::pi; };
  white.spectra_size = 33;
  const MeasuredBrdf measured = Make(white);
  EXPECT_NEAR(measured.albedo().g, 1, 0.02);
  for (float mu : {1.0f, 0.9f, 0.6f, 0.3f}) {
    const Vec3f wo = DirectionAt(mu, 1);
    constexpr uint64_t kDraws = 100000;
    double by_samples = 0, by_quadrature = 0;
    for (uint64_t i = 0; i < kDraws; ++i) {
      const auto u = CounterUniforms(1, i);
      const std::optional<Vec3f> wi = measured.Sample(wo, {u[0], u[1]});
      if (wi) {
        const auto value = measured.Eval(wo, *wi, Rgb{});
        if (value.pdf > 0) by_samples += static_cast<double>(value.f_cos.g / value.pdf) / kDraws;
      }
      const auto uniform =
          measured.Eval(wo, DirectionAt(std::fmax(u[1], 1e-6f), 6.2831853f * u[2]), Rgb{});
      by_quadrature += 2 * std::numbers::pi * static_cast<double>(uniform.f_cos.g) / kDraws;
    }
    EXPECT_NEAR(by_samples, 1, 0.03) << mu;
    EXPECT_NEAR(by_quadrature, by_samples, 0.01) << mu;
  }
}

TEST(MeasuredTest, SpectraAreLinearBetweenTheirWavelengths) {
  MeasuredFileBuilder builder = GlossyBuilder();
  const MeasuredBrdf measured = Make(builder, true);
  const Vec3f wo = DirectionAt(0.8f, 1), wi = DirectionAt(0.7f, 4);
  const Spectral f = measured.Eval(wo, wi, Spectral{{400, 475, 700, 830}}).f_cos;
  EXPECT_NEAR(f[1] / f[0], 475.0f / 400, 1e-4f);
  EXPECT_NEAR(f[2] / f[0], 700.0f / 400, 1e-4f);
  EXPECT_EQ(f[3], f[2]);  // Constant beyond the ends.
  EXPECT_EQ(measured.Eval(wo, wi, Spectral{{360, 400, 400, 400}}).f_cos[0], f[0]);
  // RGB of the same spectrum: as for any reflectance under D65.
  EXPECT_GT(measured.Eval(wo, wi, Rgb{}).f_cos.r, measured.Eval(wo, wi, Rgb{}).f_cos.b);
}

TEST(MeasuredTest, GrazingAndVerticalDirectionsAreFinite) {
  for (const MeasuredBrdf& measured : {Make(GlossyBuilder()), Make(AnisotropicBuilder())}) {
    for (float a : {1.0f, 0.999999f, 1e-3f, 1e-7f}) {
      for (float b : {1.0f, 1e-3f, 1e-7f}) {
        for (float phi : {0.0f, 3.1415927f, -3.1415927f, 1.0f}) {
          const auto value = measured.Eval(DirectionAt(a, 0), DirectionAt(b, phi), Rgb{});
          EXPECT_TRUE(IsFinite(value.f_cos) && std::isfinite(value.pdf)) << a << " " << b;
          EXPECT_GE(value.pdf, 0);
        }
      }
      for (float u : {0.0f, 0.5f, 0x1.fffffep-1f}) {
        for (float v : {0.0f, 0x1.fffffep-1f}) {
          const auto wi = measured.Sample(DirectionAt(a, 1), {u, v});
          if (wi.has_value()) {
            EXPECT_NEAR(Length(*wi), 1, 1e-6);
          }
        }
      }
    }
  }
}

}  // namespace
}  // namespace sheaf::render
