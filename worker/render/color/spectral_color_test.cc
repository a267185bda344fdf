// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/color/spectral_color.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <random>
#include <vector>

#include "common/scene/spectrum/spectrum.h"
#include "tests/support/colors.h"
#include "tests/support/hard_case.h"
#include "tests/support/naive_materials.h"
#include "worker/render/color/wavelength_sampler.h"

namespace sheaf::render {
namespace {

using sheaf::testing::BlackbodyOf;
using sheaf::testing::Named;
using sheaf::testing::RgbSpec;
using testing::ExpectNear;

// Linear sRGB of spectral radiance by the sums defined in spectrum.h.
Rgb Integrate(const std::function<double(float nm)>& radiance) {
  std::array<double, 3> sum{};
  for (int nm = kSpectrumFirstNm; nm <= kSpectrumLastNm; ++nm) {
    const double value = radiance(static_cast<float>(nm));
    const std::array<double, 3> observer = ObserverRgb(nm);
    for (size_t i = 0; i < 3; ++i) sum[i] += observer[i] * value;
  }
  return {static_cast<float>(sum[0]), static_cast<float>(sum[1]), static_cast<float>(sum[2])};
}
Rgb UnderD65(const std::function<double(float nm)>& reflectance) {
  return Integrate([&](float nm) { return reflectance(nm) * UnitD65(nm); });
}

// The mean of the estimates of many paths, with uniform primary wavelengths.
Rgb Estimate(const std::function<Spectral(const Wavelengths&)>& radiance) {
  constexpr int kPathCount = 20000;
  std::array<double, 3> sum{};
  for (int i = 0; i < kPathCount; ++i) {
    const Wavelengths w = Wavelengths::Sample((static_cast<float>(i) + 0.5f) / kPathCount);
    const Rgb rgb = RgbOf(radiance(w), w);
    for (size_t k = 0; k < 3; ++k) sum[k] += rgb[k] / kPathCount;
  }
  return {static_cast<float>(sum[0]), static_cast<float>(sum[1]), static_cast<float>(sum[2])};
}

// Colors by kind: uniform over the cube; dark; light; saturated.
Rgb RandomColor(int kind, std::mt19937* random) {
  std::uniform_real_distribution<float> uniform(0, 1);
  Rgb rgb{uniform(*random), uniform(*random), uniform(*random)};
  const float factor = Exp(-8 * uniform(*random));
  if (kind == 1) rgb *= factor;
  if (kind == 2) rgb = Rgb::Gray(1) - rgb * factor;
  if (kind == 3) rgb = rgb * rgb * rgb;
  return rgb;
}

TEST(WavelengthsTest, EachWavelengthHasItsStatedPdf) {
  constexpr int kPathCount = 200000, kBinCount = 47;
  std::array<std::array<int, kBinCount>, kWavelengthCount> counts{};
  std::mt19937 random(7);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (int i = 0; i < kPathCount; ++i) {
    const Wavelengths w = Wavelengths::Sample(std::min(uniform(random), 0x1.fffffep-1f));
    EXPECT_EQ(w.hero_nm(), w.nm[0]);
    for (size_t k = 0; k < kWavelengthCount; ++k) {
      ASSERT_GE(w.nm[k], kWavelengthMinNm);
      ASSERT_LE(w.nm[k], kWavelengthMaxNm);
      ASSERT_GT(w.pdf[k], 0);
      const float bin = (w.nm[k] - kWavelengthMinNm) / 10;
      ++counts[k][static_cast<size_t>(std::min(bin, kBinCount - 1.f))];
    }
  }
  // Integral of sech^2(0.0072 (nm - 538)), up to a factor.
  const auto tanh = [](double nm) {
    const double e = Exp(2 * 0.0072 * (nm - 538));
    return (e - 1) / (e + 1);
  };
  const double total = tanh(kWavelengthMaxNm) - tanh(kWavelengthMinNm);
  for (const auto& histogram : counts) {
    double chi_square = 0;
    for (int bin = 0; bin < kBinCount; ++bin) {
      const double low = kWavelengthMinNm + 10.0 * bin;
      const double expected = kPathCount * (tanh(low + 10) - tanh(low)) / total;
      const double excess = histogram[static_cast<size_t>(bin)] - expected;
      chi_square += excess * excess / expected;
    }
    EXPECT_LT(chi_square, 90);  // 46 degrees of freedom: probability 1e-4.
  }
}

TEST(WavelengthsTest, PdfIsTheInverseSampleSpacing) {
  for (float u = 0.01f; u < 0.24f; u += 0.01f) {  // No wavelength wraps around within the step.
    constexpr float kStep = 1e-3f;
    const Wavelengths low = Wavelengths::Sample(u - kStep), high = Wavelengths::Sample(u + kStep);
    const Wavelengths w = Wavelengths::Sample(u);
    for (size_t k = 0; k < kWavelengthCount; ++k) {
      EXPECT_NEAR((high.nm[k] - low.nm[k]) * w.pdf[k] / (2 * kStep), 1, 2e-3) << u << " " << k;
    }
  }
}

// The samples in parts of the bands, in whole nanometers beside them and in the rest, against the
// integral of the stated density.
TEST(WavelengthSamplerTest, EachWavelengthHasItsStatedPdf) {
  const std::vector<std::vector<NarrowBand>> spectra = {
      {{589.1, 589.3, 0, 1, 0, 0}, {589.3, 589.5, 1, 0, 0, 0}},
      {{532, 532.5, 0, 2, 0, 0}, {532.5, 533, 2, 0, 0, 0}, {540, 540.01, 5, 5, 0, 0}},
      {{589.4, 589.6, 1, 1, 0, 0}}};
  const WavelengthSampler sampler(spectra);
  const std::vector<double> edges = {360,   500,    532,   532.25, 532.5, 533,    539,
                                     540,   540.01, 541,   589,    589.1, 589.25, 589.3,
                                     589.4, 589.5,  589.6, 590,    650,   830};
  constexpr int kPathCount = 400000;
  std::vector<std::array<double, kWavelengthCount>> counts(edges.size());
  std::vector<double> widths(edges.size());  // The mean of 1 / pdf within.
  std::mt19937 random(11);
  std::uniform_real_distribution<float> uniform(0, 1);
  for (int i = 0; i < kPathCount; ++i) {
    const Wavelengths w = sampler.Sample(std::min(uniform(random), 0x1.fffffep-1f));
    for (size_t k = 0; k < kWavelengthCount; ++k) {
      ASSERT_GT(w.pdf[k], 0);
      const auto bin = static_cast<size_t>(
          std::upper_bound(edges.begin(), edges.end(), static_cast<double>(w.nm[k])) -
          edges.begin());
      ++counts[bin - 1][k];
      widths[bin - 1] += 1 / static_cast<double>(w.pdf[k]) / kPathCount / kWavelengthCount;
    }
  }
  for (size_t bin = 0; bin + 1 < edges.size(); ++bin) {
    const double width = edges[bin + 1] - edges[bin];
    const double count = counts[bin][0] + counts[bin][1] + counts[bin][2] + counts[bin][3];
    EXPECT_NEAR(widths[bin] / width, 1, 6 / std::sqrt(count) + 0.002) << edges[bin];
  }
  // Chi-square: each of the four wavelengths has the same distribution.
  double chi_square = 0;
  for (size_t bin = 0; bin + 1 < edges.size(); ++bin) {
    const auto& four = counts[bin];
    const double expected = (four[0] + four[1] + four[2] + four[3]) / kWavelengthCount;
    for (const double n : four) chi_square += (n - expected) * (n - expected) / expected;
  }
  EXPECT_LT(chi_square, 105);  // At most 57 degrees of freedom: probability 1e-4.
}

TEST(WavelengthSamplerTest, WithoutBandsNothingChanges) {
  for (const float u : {0.0f, 0.3f, 0.7f}) {
    EXPECT_EQ(WavelengthSampler().Sample(u).nm, Wavelengths::Sample(u).nm);
    EXPECT_EQ(WavelengthSampler(std::vector<std::vector<NarrowBand>>(1)).Sample(u).pdf,
              Wavelengths::Sample(u).pdf);
  }
  for (float u = 0; u < 1; u += 0.07f) {
    const Wavelengths w = Wavelengths::Sample(u);
    EXPECT_NEAR(Wavelengths::PdfOf(w.nm[0]) / w.pdf[0], 1, 1e-5);
  }
}

TEST(SigmoidSpectrumTest, M14GraysAreConstant) {
  for (const float gray : {0.f, 1e-6f, 0.01f, 0.18f, 0.5f, 0.73f, 0.999f, 1.f}) {
    const SigmoidSpectrum spectrum = FitSigmoid(Rgb::Gray(gray));
    EXPECT_EQ(spectrum.c1, 0);
    EXPECT_EQ(spectrum.c2, 0);
    EXPECT_EQ(spectrum.At(361), spectrum.At(777));
    EXPECT_NEAR(spectrum.At(500), gray, 4e-7f * gray);
  }
  EXPECT_EQ(FitSigmoid(Rgb::Gray(0)).At(500), 0);
  EXPECT_EQ(FitSigmoid(Rgb::Gray(0.5f)).At(500), 0.5f);
  ExpectHardCase({.row = "M14",
                  .figure = "white at 500 nm",
                  .expected = 1,
                  .measured = FitSigmoid(Rgb::Gray(1)).At(500),
                  .naive = naive::Sigmoid(std::numeric_limits<float>::infinity()),
                  .naive_by = "1/2 + x / (2 sqrt(1 + x^2)) of white's infinite coefficient"});
}

TEST(SigmoidSpectrumTest, ColorsKeepTheirRgb) {
  std::mt19937 random(1);
  for (int i = 0; i < 2000; ++i) {
    const Rgb rgb = RandomColor(i % 4, &random);
    const SigmoidSpectrum spectrum = FitSigmoid(rgb);
    ExpectNear(UnderD65([&](float nm) { return spectrum.At(nm); }), rgb, 1e-5f * MaxComponent(rgb));
  }
}

TEST(SigmoidSpectrumTest, M14EdgesOfTheGamutAreReached) {
  const Rgb edges[] = {{1, 0, 0},         {0, 1, 0},        {0, 0, 1},         {1, 1, 0},
                       {0, 1, 1},         {1, 0, 1},        {0.9f, 0.001f, 0}, {0, 0.5f, 0},
                       {1e-6f, 5e-7f, 0}, {1.f / 16, 0, 0}, {1, 0.9999f, 1},   {1, 1, 0.999f},
                       {0.01f, 0, 1},     {0.5f, 0.5f, 0},  {0.2f, 0, 1e-7f},  {0.999f, 1, 0}};
  for (const Rgb rgb : edges) {
    const SigmoidSpectrum spectrum = FitSigmoid(rgb);
    const Rgb seen = UnderD65([&](float nm) { return spectrum.At(nm); });
    ExpectNear(seen, rgb, 1e-4f * MaxComponent(rgb));
  }
  // Saturated and almost black, for which no such spectrum is closer.
  const SigmoidSpectrum dark = FitSigmoid({1e-6f, 0, 0});
  ExpectNear(UnderD65([&](float nm) { return dark.At(nm); }), {1e-6f, 0, 0}, 1e-8f);
}

TEST(SigmoidSpectrumTest, InvalidReflectancesAreClamped) {
  const Rgb clamped{1, 0, 0.25f};
  const SigmoidSpectrum spectrum = FitSigmoid({1.5f, -0.5f, 0.25f});
  ExpectNear(UnderD65([&](float nm) { return spectrum.At(nm); }), clamped, 1e-4f);
  for (const float dark : {1e-12f, 1e-25f, 1e-38f, 1e-45f}) {
    const SigmoidSpectrum almost_black = FitSigmoid({dark, dark / 2, 0});
    for (const float nm : {360.f, 500.f, 830.f}) EXPECT_TRUE(std::isfinite(almost_black.At(nm)));
  }
}

TEST(SpectralColorTest, RgbOfOneTimesD65IsWhite) {
  const SpectralColor white = SpectralColor::Make(RgbSpec(Rgb::Gray(1)), ColorRole::kIlluminant);
  ExpectNear(Estimate([&](const Wavelengths& w) { return white.At(w); }), Rgb::Gray(1), 1e-4f);
  EXPECT_FLOAT_EQ(white.At(561), static_cast<float>(UnitD65(561)));
}

TEST(SpectralColorTest, ReflectanceUnderWhiteHasItsRgb) {
  const SpectralColor white = SpectralColor::Make(RgbSpec(Rgb::Gray(1)), ColorRole::kIlluminant);
  for (const Rgb rgb : {Rgb{0.8f, 0.3f, 0.1f}, Rgb{0, 0.02f, 0.01f}, Rgb{0.95f, 0.96f, 0.99f}}) {
    const SpectralColor color = SpectralColor::Make(RgbSpec(rgb), ColorRole::kReflectance);
    ExpectNear(Estimate([&](const Wavelengths& w) { return white.At(w) * color.At(w); }), rgb,
               3e-4f);
  }
}

TEST(SpectralColorTest, OutOfGamutColorsKeepTheirRgb) {
  for (const Rgb rgb :
       {Rgb{-0.05f, 0.6f, 0.2f}, Rgb{0.8f, 0.1f, -0.02f}, Rgb{-0.01f, 0.02f, 0.04f}}) {
    ColorSpec color;
    color.is_out_of_gamut = true;
    color.true_rgb = rgb;
    for (const float scale : {1.f, 30.f}) {
      color.true_rgb = rgb * scale;
      const SpectralColor light = SpectralColor::Make(color, ColorRole::kIlluminant);
      ExpectNear(Integrate([&](float nm) { return light.At(nm); }), color.true_rgb, 2e-3f * scale);
    }
    color.true_rgb = rgb;
    const SpectralColor surface = SpectralColor::Make(color, ColorRole::kReflectance);
    ExpectNear(UnderD65([&](float nm) { return surface.At(nm); }), rgb, 2e-3f);
    for (float nm = 360; nm <= 830; nm += 10) {
      EXPECT_GE(surface.At(nm), 0);
      EXPECT_LE(surface.At(nm), 1);
    }
  }
}

TEST(SpectralColorTest, M14GraysAreExact) {
  const Wavelengths w = Wavelengths::Sample(0.3f);
  for (const float gray : {0.f, 1e-4f, 0.02f, 0.18f, 0.5f, 0.999f, 1.f}) {
    for (const ColorRole role : {ColorRole::kReflectance, ColorRole::kUnbounded}) {
      EXPECT_EQ(SpectralColor::Make(RgbSpec(Rgb::Gray(gray)), role).At(w), Spectral::Gray(gray));
      EXPECT_EQ(Upsample(Rgb::Gray(gray), role, w), Spectral::Gray(gray));
    }
  }
  const ColorSpec bright = RgbSpec(Rgb::Gray(1234.5f));
  EXPECT_EQ(SpectralColor::Make(bright, ColorRole::kUnbounded).At(w), Spectral::Gray(1234.5f));
  EXPECT_EQ(SpectralColor::Make(bright, ColorRole::kReflectance).At(w), Spectral::Gray(1));
  EXPECT_TRUE(SpectralColor().At(w).IsBlack());
}

TEST(SpectralColorTest, EmissionIsUnbounded) {
  for (const Rgb rgb : {Rgb{40, 25, 3}, Rgb{0, 0, 1e6f}, Rgb{1e-6f, 2e-6f, 0}}) {
    const SpectralColor light = SpectralColor::Make(RgbSpec(rgb), ColorRole::kIlluminant);
    const SpectralColor plain = SpectralColor::Make(RgbSpec(rgb), ColorRole::kUnbounded);
    const float tolerance = 1e-4f * MaxComponent(rgb);
    ExpectNear(Integrate([&](float nm) { return light.At(nm); }), rgb, tolerance);
    ExpectNear(UnderD65([&](float nm) { return plain.At(nm); }), rgb, tolerance);
  }
}

TEST(SpectralColorTest, SpectraOfLightsHaveLuminanceOne) {
  for (const ColorSpec& spectrum :
       {Named("stdillum-A"), Named("stdillum-D50"), BlackbodyOf(5000), BlackbodyOf(1200)}) {
    const SpectralColor light = SpectralColor::Make(spectrum, ColorRole::kIlluminant);
    const Rgb rgb = Estimate([&](const Wavelengths& w) { return light.At(w); });
    EXPECT_NEAR(Luminance(rgb), 1, 1e-3);
    if (spectrum.temperature_k == 1200) continue;  // Outside the gamut, to which RGB is clamped.
    ExpectNear(rgb, SpectrumToRgb(spectrum, ColorRole::kIlluminant), 1e-3f);
  }
  ColorSpec dark;
  dark.kind = ColorSpec::Kind::kSampled;
  dark.wavelengths_nm = {400, 700};
  dark.values = {0, 0};
  EXPECT_EQ(SpectralColor::Make(dark, ColorRole::kIlluminant).At(500), 0);
}

TEST(SpectralColorTest, MeasuredSpectraAreUsedUnchanged) {
  const ColorSpec glass = Named("glass-BK7");
  const SpectralColor eta = SpectralColor::Make(glass, ColorRole::kUnbounded);
  for (const double nm : {365.0, 486.1, 587.6, 656.3, 820.0}) {
    EXPECT_NEAR(eta.At(static_cast<float>(nm)), EvaluateSpectrum(glass, nm), 1e-4) << nm;
  }
  ColorSpec ramp;
  ramp.kind = ColorSpec::Kind::kSampled;
  ramp.wavelengths_nm = {400, 600};
  ramp.values = {-1, 3};
  const SpectralColor reflectance = SpectralColor::Make(ramp, ColorRole::kReflectance);
  EXPECT_EQ(reflectance.At(420), 0);
  EXPECT_FLOAT_EQ(reflectance.At(475.5f), 0.51f);
  EXPECT_EQ(reflectance.At(590), 1);
  EXPECT_EQ(reflectance.At(601), 0);
}

TEST(SpectralColorTest, FourWavelengthsEvaluateIndependently) {
  const ColorSpec colors[] = {RgbSpec({0.8f, 0.3f, 0.1f}), Named("stdillum-A")};
  for (const ColorSpec& spec : colors) {
    const SpectralColor color = SpectralColor::Make(spec, ColorRole::kIlluminant);
    for (const float u : {0.f, 0.1f, 0.777f, 0x1.fffffep-1f}) {
      const Wavelengths w = Wavelengths::Sample(u);
      const Spectral values = color.At(w);
      for (size_t i = 0; i < kWavelengthCount; ++i) EXPECT_EQ(values[i], color.At(w.nm[i]));
    }
  }
}

TEST(SpectralColorTest, MetalsMatchRgbTransport) {
  const ColorSpec eta = Named("metal-Cu-eta"), k = Named("metal-Cu-k");
  const SpectralColor eta_at = SpectralColor::Make(eta, ColorRole::kUnbounded);
  const SpectralColor k_at = SpectralColor::Make(k, ColorRole::kUnbounded);
  const SpectralColor white = SpectralColor::Make(RgbSpec(Rgb::Gray(1)), ColorRole::kIlluminant);
  const Rgb seen = Estimate([&](const Wavelengths& w) {
    const Spectral n = eta_at.At(w), absorption = k_at.At(w);
    Spectral radiance = white.At(w);
    for (size_t i = 0; i < kWavelengthCount; ++i) {
      radiance[i] *= static_cast<float>(ConductorNormalReflectance(n[i], absorption[i]));
    }
    return radiance;
  });
  const ConductorConstants constants = ConductorRgb(eta, k);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(seen[i], ConductorNormalReflectance(constants.eta[i], constants.k[i]), 5e-4);
  }
}

TEST(UpsampleTest, ColorsKeepTheirRgb) {
  PrepareUpsampling();
  std::mt19937 random(3);
  double sum = 0;
  constexpr int kColorCount = 4000;
  for (int i = 0; i < kColorCount; ++i) {
    const Rgb rgb = RandomColor(i % 4, &random);
    const auto spectrum = [&](float nm) {
      return Upsample(rgb, ColorRole::kReflectance, {{nm, nm, nm, nm}, {1, 1, 1, 1}})[0];
    };
    const Rgb error = UnderD65(spectrum) - rgb;
    const float largest =
        std::max({std::fabs(error.r), std::fabs(error.g), std::fabs(error.b)}) / MaxComponent(rgb);
    EXPECT_LT(largest, 6e-3f) << rgb.r << " " << rgb.g << " " << rgb.b;
    sum += largest;
  }
  EXPECT_LT(sum / kColorCount, 1e-3);
}

TEST(UpsampleTest, MatchesIndividuallyFittedColors) {
  std::mt19937 random(4);
  for (int i = 0; i < 1000; ++i) {
    const Rgb rgb = RandomColor(i % 4, &random);
    const ColorRole role = i % 3 == 0   ? ColorRole::kReflectance
                           : i % 3 == 1 ? ColorRole::kIlluminant
                                        : ColorRole::kUnbounded;
    const SpectralColor color = SpectralColor::Make(RgbSpec(rgb), role);
    // The mean difference as seen under D65; the range's ends, where spectra of saturated colors
    // have steps, contribute little.
    double difference = 0;
    for (int nm = kSpectrumFirstNm; nm <= kSpectrumLastNm; nm += 5) {
      const auto x = static_cast<float>(nm);
      const Wavelengths w = {{x, x, x, x}, {1, 1, 1, 1}};
      const double light = role == ColorRole::kIlluminant ? 1 : UnitD65(nm);
      const std::array<double, 3> observer = ObserverRgb(nm);
      const double seen = std::fabs(observer[0]) + std::fabs(observer[1]) + std::fabs(observer[2]);
      difference += 5.0 / 3 * seen * light * std::fabs(Upsample(rgb, role, w)[0] - color.At(x));
    }
    EXPECT_LT(difference, 0.01 * MaxComponent(rgb)) << rgb.r << " " << rgb.g << " " << rgb.b;
  }
}

TEST(UpsampleTest, BitsAreMachineIndependent) {
  const Rgb rgb{0.8f, 0.3f, 0.1f};
  const SigmoidSpectrum fitted = FitSigmoid(rgb);
  EXPECT_EQ(fitted.c0, -0x1.62ddfp+0f);
  EXPECT_EQ(fitted.c1, 0x1.1562ap-2f);
  EXPECT_EQ(fitted.c2, 0x1.6393aep+2f);
  const Wavelengths w = Wavelengths::Sample(0.3f);
  const Spectral emission = Upsample(rgb, ColorRole::kIlluminant, w);
  EXPECT_EQ(emission,
            (Spectral{{0x1.ef33e8p-10f, 0x1.c2edaep-9f, 0x1.a66ee2p-8f, 0x1.3fea2p-11f}}));
  EXPECT_EQ(RgbOf(emission, w), (Rgb{0x1.d3427ap-1f, 0x1.1bf5dcp-2f, 0x1.a0f218p-8f}));
}

// An unreadable texture gives NaN. RGB transport counts such samples; spectral transport must, too.
TEST(UpsampleTest, NanStaysNan) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const Wavelengths w = Wavelengths::Sample(0.3f);
  for (const ColorRole role :
       {ColorRole::kReflectance, ColorRole::kIlluminant, ColorRole::kUnbounded}) {
    EXPECT_FALSE(IsFinite(Upsample({nan, nan, nan}, role, w)));
    EXPECT_FALSE(IsFinite(Upsample({0.5f, nan, 0.2f}, role, w)));
  }
}

TEST(UpsampleTest, IsContinuousNearGraysAndBlack) {
  const Wavelengths w = Wavelengths::Sample(0.2f);
  for (const float gray : {0.001f, 1.f / 16, 0.3f, 0.9f, 0.9999f, 1.f}) {
    const Spectral near = Upsample({gray, gray * (1 - 1e-6f), gray}, ColorRole::kReflectance, w);
    for (size_t k = 0; k < kWavelengthCount; ++k) EXPECT_NEAR(near[k], gray, 1e-5f);
  }
  EXPECT_TRUE(Upsample({0, 0, 0}, ColorRole::kIlluminant, w).IsBlack());
  EXPECT_TRUE(Upsample({-2, -1, 0}, ColorRole::kUnbounded, w).IsBlack());
  EXPECT_TRUE(IsFinite(Upsample({1e-45f, 1e-38f, 0}, ColorRole::kReflectance, w)));
  EXPECT_TRUE(IsFinite(Upsample({1e30f, 1, 0}, ColorRole::kIlluminant, w)));
}

}  // namespace
}  // namespace sheaf::render
