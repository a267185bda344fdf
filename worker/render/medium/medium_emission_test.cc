// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/medium/medium_emission.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "common/scene/spectrum/spectrum.h"
#include "common/volume/volume_array.h"

namespace sheaf::render {
namespace {

TEST(MediumEmissionTest, BlackbodiesFollowPlanckRelativeToTheirPeak) {
  for (const float kelvin : {500.0f, 1200.0f, 3000.0f, 6500.0f, 30000.0f}) {
    SCOPED_TRACE(kelvin);
    ColorSpec planck;
    planck.kind = ColorSpec::Kind::kBlackbody;
    planck.temperature_k = kelvin;
    const double peak_nm = 2.8977721e6 / static_cast<double>(kelvin);
    EXPECT_NEAR(BlackbodyOfPeakOne(kelvin, static_cast<float>(peak_nm)), 1, 1e-6);
    for (const float nm : {360.0f, 450.0f, 550.0f, 700.0f, 830.0f}) {
      const double expected =
          EvaluateSpectrum(planck, static_cast<double>(nm)) / EvaluateSpectrum(planck, peak_nm);
      EXPECT_NEAR(BlackbodyOfPeakOne(kelvin, nm) / expected, 1, 1e-5) << nm;
    }
  }
  EXPECT_EQ(BlackbodyOfPeakOne(0, 500), 0);
  EXPECT_EQ(BlackbodyOfPeakOne(-5, 500), 0);
  EXPECT_EQ(BlackbodyOfPeakOne(1, 360), 0);
}

TEST(MediumEmissionTest, RgbIsTheIntegralOfTheSpectrum) {
  for (float kelvin = 500; kelvin < 90000; kelvin *= 1.0371f) {
    std::array<double, 3> expected{};
    for (int nm = kSpectrumFirstNm; nm <= kSpectrumLastNm; ++nm) {
      const std::array<double, 3> observer = ObserverRgb(nm);
      const auto value = static_cast<double>(BlackbodyOfPeakOne(kelvin, static_cast<float>(nm)));
      for (size_t c = 0; c < 3; ++c) expected[c] += value * observer[c];
    }
    const Rgb rgb = BlackbodyRgbOfPeakOne(kelvin);
    for (size_t c = 0; c < 3; ++c) {
      const double positive = std::max(expected[c], 0.0);
      EXPECT_NEAR(rgb[c], positive, 1e-3 * std::max(expected[0], positive)) << kelvin << " " << c;
    }
  }
  EXPECT_EQ(BlackbodyRgbOfPeakOne(1e6f), BlackbodyRgbOfPeakOne(102400));
  EXPECT_TRUE(BlackbodyRgbOfPeakOne(0).IsBlack());
}

TEST(MediumEmissionTest, GridsProvideTemperaturesAndFactors) {
  const Affine placed{{2, 0, 0}, {0, 2, 0}, {0, 0, 2}, {10, 0, 0}};
  const auto grid = [](float value) {
    return *VolumeGridFromArray("a", "g", {{2, 2, 2}, {}, {1, 1, 1}}, std::vector<float>(8, value));
  };
  ColorSpec color;
  color.rgb = {3, 2, 1};
  MediumEmission emission(placed, color, 0.5f, false);
  EXPECT_EQ(emission.At<Rgb>({11, 1, 1}, {}), (Rgb{1.5f, 1, 0.5f}));
  emission.SetFactors(grid(4));
  EXPECT_EQ(emission.At<Rgb>({11, 1, 1}, {}), (Rgb{6, 4, 2}));
  emission.SetTemperatures(grid(30), {10, 100});  // (30 - 10) * 100 K.
  EXPECT_EQ(emission.At<Rgb>({11, 1, 1}, {}), BlackbodyRgbOfPeakOne(2000) * 2);
  MediumEmission cold(placed, {}, 1, false);
  cold.SetTemperatures(grid(99), {});
  EXPECT_TRUE(cold.At<Rgb>({11, 1, 1}, {}).IsBlack());
}

}  // namespace
}  // namespace sheaf::render
