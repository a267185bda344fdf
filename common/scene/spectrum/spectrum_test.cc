// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/spectrum/spectrum.h"

#include <gtest/gtest.h>

#include <array>
#include <string>

#include "tests/support/colors.h"

namespace sheaf {
namespace {

using testing::BlackbodyOf;
using testing::ExpectNear;
using testing::Named;
using testing::Sampled;

TEST(SpectrumTest, ConstantReflectanceIsGray) {
  ExpectNear(SpectrumToRgb(Sampled({300, 900}, {0.25f, 0.25f}), ColorRole::kReflectance),
             Rgb::Gray(0.25f), 1e-6f);
}

TEST(SpectrumTest, DaylightTableAgreesWithTheStandard) {
  // Relative spectral power of D65 and D50. Source: CIE 15:2004, table T.1.
  const double scale65 = 100 / EvaluateSpectrum(Named("stdillum-D65"), 560);
  EXPECT_NEAR(EvaluateSpectrum(Named("stdillum-D65"), 400) * scale65, 82.7549, 0.1);
  EXPECT_NEAR(EvaluateSpectrum(Named("stdillum-D65"), 460) * scale65, 117.812, 0.1);
  EXPECT_NEAR(EvaluateSpectrum(Named("stdillum-D65"), 700) * scale65, 71.6091, 0.1);
  const double scale50 = 100 / EvaluateSpectrum(Named("stdillum-D50"), 560);
  EXPECT_NEAR(EvaluateSpectrum(Named("stdillum-D50"), 400) * scale50, 49.30, 0.5);
  EXPECT_NEAR(EvaluateSpectrum(Named("stdillum-A"), 700), 198.261, 0.01);
  EXPECT_NEAR(EvaluateSpectrum(Named("stdillum-A"), 400), 14.708, 0.001);
}

TEST(SpectrumTest, FluorescentLampsHaveTheirChromaticities) {
  // CIE 15:2004, table T.8: sums of steps of 5 nm, rounded to four digits.
  constexpr double kChromaticities[12][2] = {{0.3131, 0.3371}, {0.3721, 0.3751}, {0.4091, 0.3941},
                                             {0.4402, 0.4031}, {0.3138, 0.3452}, {0.3779, 0.3882},
                                             {0.3129, 0.3292}, {0.3458, 0.3586}, {0.3741, 0.3727},
                                             {0.3458, 0.3588}, {0.3805, 0.3769}, {0.4370, 0.4042}};
  for (size_t i = 0; i < 12; ++i) {
    const auto [x, y] = kChromaticities[i];
    const std::array<double, 3> expected = SrgbFromXyz({x / y, 1, (1 - x - y) / y});
    const Rgb rgb =
        SpectrumToRgb(Named("stdillum-F" + std::to_string(i + 1)), ColorRole::kIlluminant);
    for (size_t c = 0; c < 3; ++c) EXPECT_NEAR(rgb[c], expected[c], 5e-3) << i + 1;
  }
  EXPECT_EQ(EvaluateSpectrum(Named("stdillum-F1"), 379), 0);
  EXPECT_FALSE(IsNamedSpectrum("stdillum-F13"));
}

TEST(SpectrumTest, IlluminantsHaveLuminanceOneWhateverTheirMagnitude) {
  ExpectNear(SpectrumToRgb(Named("stdillum-D65"), ColorRole::kIlluminant), Rgb::Gray(1), 1e-6f);
  const Rgb one = SpectrumToRgb(Sampled({300, 900}, {1, 1}), ColorRole::kIlluminant);
  const Rgb five = SpectrumToRgb(Sampled({300, 900}, {5, 5}), ColorRole::kIlluminant);
  ExpectNear(one, five, 1e-6f);
  // Illuminant E in sRGB. Source: Lindbloom, companion of chromaticity (1/3, 1/3) under D65.
  ExpectNear(one, {1.2048f, 0.9483f, 0.9087f}, 2e-3f);
}

TEST(SpectrumTest, ObserverAndD65AreNormalizedConsistently) {
  ColorSpec warm = BlackbodyOf(3000);
  const double luminance = SpectrumLuminance(warm);
  std::array<double, 3> white{}, light{};
  for (int nm = kSpectrumFirstNm; nm <= kSpectrumLastNm; ++nm) {
    const std::array<double, 3> observer = ObserverRgb(nm);
    for (size_t i = 0; i < 3; ++i) {
      white[i] += observer[i] * UnitD65(nm);
      light[i] += observer[i] * EvaluateSpectrum(warm, nm) / luminance;
    }
  }
  const Rgb expected = SpectrumToRgb(warm, ColorRole::kIlluminant);
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(white[i], 1, 1e-9);
    EXPECT_NEAR(light[i], expected[i], 1e-6);
  }
  EXPECT_EQ(UnitD65(300), UnitD65(360));
  EXPECT_NEAR(UnitD65(500.5), 0.5 * (UnitD65(500) + UnitD65(501)), 1e-12);
}

TEST(SpectrumTest, BlackbodiesLieOnThePlanckianLocus) {
  // (x, y) = (0.4476, 0.4074) at 2856 K (illuminant A), as linear sRGB of luminance 1.
  ExpectNear(SpectrumToRgb(BlackbodyOf(2856), ColorRole::kIlluminant),
             SpectrumToRgb(Named("stdillum-A"), ColorRole::kIlluminant), 2e-3f);
  const Rgb warm = SpectrumToRgb(BlackbodyOf(2856), ColorRole::kIlluminant);
  ExpectNear(warm, {1.8457f, 0.8261f, 0.2334f}, 3e-3f);
  // Below about 1900 K blue is outside of the gamut and clamped.
  EXPECT_EQ(SpectrumToRgb(BlackbodyOf(1000), ColorRole::kIlluminant).b, 0);
}

TEST(SpectrumTest, MetalsReflectAsMeasured) {
  // Reflectance at normal incidence and 589 nm from the Drude-like tables of Johnson and Christy.
  const auto reflectance = [](const char* metal, double nm) {
    return ConductorNormalReflectance(
        EvaluateSpectrum(Named(std::string("metal-") + metal + "-eta"), nm),
        EvaluateSpectrum(Named(std::string("metal-") + metal + "-k"), nm));
  };
  EXPECT_NEAR(reflectance("Cu", 650), 0.945, 0.01);
  EXPECT_NEAR(reflectance("Cu", 450), 0.553, 0.01);
  EXPECT_NEAR(reflectance("Au", 650), 0.937, 0.02);
  EXPECT_NEAR(reflectance("Au", 450), 0.387, 0.02);
  EXPECT_NEAR(reflectance("Ag", 550), 0.958, 0.01);
  EXPECT_NEAR(reflectance("Al", 550), 0.916, 0.01);
}

TEST(SpectrumTest, ConductorChannelsMatchTheSpectralColor) {
  for (const double outside : {1.0, 1.5}) {  // In air and under a coat.
    const ConductorConstants copper =
        ConductorRgb(Named("metal-Cu-eta"), Named("metal-Cu-k"), static_cast<float>(outside));
    std::vector<float> nm, values;
    for (int i = 360; i <= 830; ++i) {
      nm.push_back(static_cast<float>(i));
      values.push_back(static_cast<float>(
          ConductorNormalReflectance(EvaluateSpectrum(Named("metal-Cu-eta"), i) / outside,
                                     EvaluateSpectrum(Named("metal-Cu-k"), i) / outside)));
    }
    const Rgb expected = SpectrumToRgb(Sampled(nm, values), ColorRole::kReflectance);
    for (size_t i = 0; i < 3; ++i) {
      EXPECT_NEAR(ConductorNormalReflectance(copper.eta[i] / outside, copper.k[i] / outside),
                  expected[i], 1e-5);
    }
  }
}

TEST(SpectrumTest, ConductorsFromRgbAndReflectance) {
  ColorSpec eta, k;
  eta.rgb = {0.2f, 0.9f, 1.1f};
  k.rgb = {3.9f, 2.4f, 2.2f};
  const ConductorConstants same = ConductorRgb(eta, k);
  EXPECT_EQ(same.eta, eta.rgb);
  EXPECT_EQ(same.k, k.rgb);
  const ConductorConstants gray = ConductorFromReflectance({0, 0.5f, 1});
  EXPECT_NEAR(ConductorNormalReflectance(gray.eta.g, gray.k.g), 0.5, 1e-6);
  EXPECT_EQ(gray.k.r, 0);
  EXPECT_TRUE(std::isfinite(gray.k.b));
}

TEST(SpectrumTest, NarrowBandsLieOutsideSrgb) {
  const ColorSpec sodium = Sampled({588, 589, 590, 591}, {0, 1, 1, 0});
  EXPECT_FALSE(IsWithinSrgb(sodium, ColorRole::kIlluminant));
  EXPECT_FALSE(IsWithinSrgb(Sampled({480, 500, 520, 540}, {0, 1, 1, 0}), ColorRole::kReflectance));
  EXPECT_TRUE(IsWithinSrgb(BlackbodyOf(5000), ColorRole::kIlluminant));
  EXPECT_TRUE(IsWithinSrgb(Named("stdillum-D65"), ColorRole::kIlluminant));
  EXPECT_TRUE(IsWithinSrgb(Sampled({300, 900}, {1, 1}), ColorRole::kReflectance));
}

TEST(SpectrumTest, MeanGlassIndexIsThatOfYellowGreenLight) {
  EXPECT_NEAR(MeanIndex(Named("glass-BK7")), 1.5179, 1e-3);
  EXPECT_NEAR(MeanIndex(Sampled({300, 900}, {1.25f, 1.25f})), 1.25, 1e-6);
}

TEST(SpectrumTest, EveryNamedSpectrumEvaluates) {
  for (const std::string& name : NamedSpectra()) {
    ASSERT_TRUE(IsNamedSpectrum(name)) << name;
    for (const double nm : {360.0, 555.5, 830.0}) {
      EXPECT_TRUE(std::isfinite(EvaluateSpectrum(Named(name), nm))) << name << " at " << nm;
    }
  }
  EXPECT_FALSE(IsNamedSpectrum("metal-Xx-eta"));
}

}  // namespace
}  // namespace sheaf
