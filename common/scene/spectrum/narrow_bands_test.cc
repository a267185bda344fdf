// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/spectrum/narrow_bands.h"

#include <cmath>
#include <vector>

#include "common/scene/spectrum/spectrum.h"
#include "gtest/gtest.h"
#include "tests/support/colors.h"

namespace sheaf {
namespace {

using testing::Sampled;

ColorSpec Line(float nm, float half_width) {
  return Sampled({nm - half_width, nm, nm + half_width}, {0, 1, 0});
}

TEST(NarrowBandsTest, SpectraThatATableRepresentsHaveNone) {
  EXPECT_TRUE(NarrowBandsOf(Sampled({300, 900}, {1, 1})).empty());
  EXPECT_TRUE(NarrowBandsOf(Line(532, 1)).empty());
  EXPECT_TRUE(NarrowBandsOf(Line(532.5f, 1)).empty());
  // A measured curve in steps of 1/4 nm.
  ColorSpec fine = Sampled({}, {});
  for (int i = 0; i <= 4 * 300; ++i) {
    fine.wavelengths_nm.push_back(400 + 0.25f * static_cast<float>(i));
    fine.values.push_back(1 + 0.5f * std::sin(0.02f * static_cast<float>(i)));
  }
  EXPECT_TRUE(NarrowBandsOf(fine).empty());
  // A wide band with steep edges.
  EXPECT_TRUE(NarrowBandsOf(Sampled({399.9f, 400, 700, 700.1f}, {0, 1, 1, 0})).empty());
}

TEST(NarrowBandsTest, BandsHaveTheValuesOfTheSpectrum) {
  for (const float nm : {532.0f, 532.5f, 589.3f}) {
    const ColorSpec line = Line(nm, 0.2f);
    const std::vector<NarrowBand> bands = NarrowBandsOf(line);
    double integral = 0;
    for (size_t i = 0; i < bands.size(); ++i) {
      const NarrowBand& band = bands[i];
      EXPECT_GE(band.first_nm, i == 0 ? 0 : bands[i - 1].last_nm);
      const double middle = 0.5 * (band.first_nm + band.last_nm);
      EXPECT_NEAR(band.At(middle), EvaluateSpectrum(line, middle), 1e-3);
      integral += band.Integral();
    }
    EXPECT_NEAR(integral, 0.2, 1e-4) << nm;  // A triangle of height 1.
  }
}

// The luminance of a line is its integral, wherever it lies between whole nanometers.
TEST(NarrowBandsTest, LinesHaveTheLuminanceOfTheirIntegral) {
  for (const float half_width : {0.5f, 0.2f, 0.01f}) {
    for (const float nm : {588.8f, 589.0f, 589.3f, 589.5f}) {
      const double width = half_width;  // The width of a triangle of height 1.
      EXPECT_NEAR(SpectrumLuminance(Line(nm, half_width)) / (width * LuminousEfficiency(nm)), 1,
                  0.01)
          << nm << " " << half_width;
    }
  }
  // Steps: the values on either side of one wavelength.
  EXPECT_NEAR(SpectrumLuminance(Sampled({532.1f, 532.1f, 532.4f, 532.4f}, {0, 1, 1, 0})) /
                  (0.3 * LuminousEfficiency(532.25)),
              1, 0.01);
}

}  // namespace
}  // namespace sheaf
