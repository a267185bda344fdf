// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/spectrum/sensor.h"

#include <gtest/gtest.h>

#include "common/scene/spectrum/primaries.h"
#include "common/scene/spectrum/spectrum.h"
#include "tests/support/sensor_images.h"

namespace sheaf {
namespace {

// The film's sum for a light of luminance 1.
Vec3d Summed(const std::string& sensor, const ColorSpec& light) {
  const Matrix4 summed_from_sensor = SummedFromSensor(sensor);
  const double luminance = SpectrumLuminance(light);
  Vec3d sum;
  for (int nm = kSpectrumFirstNm; nm <= kSpectrumLastNm; ++nm) {
    const std::array<double, 3> response = SensorResponse(sensor, nm);
    sum += Vec3d{response[0], response[1], response[2]} * (EvaluateSpectrum(light, nm) / luminance);
  }
  return TransformVector(summed_from_sensor, sum);
}

TEST(SensorTest, ColorsMatchTheDocumentedModel) {
  for (const testing::SensorImage& image : testing::SensorImages()) {
    const ImageColor color = ImageColorOf(image.primaries, image.white_balance_k, image.sensor);
    for (size_t i = 0; i < testing::SensorLights().size(); ++i) {
      const testing::SensorLight& light = testing::SensorLights()[i];
      SCOPED_TRACE(std::string(image.sensor) + ", " + light.name);
      ColorSpec spec;
      spec.kind = light.blackbody_k > 0 ? ColorSpec::Kind::kBlackbody : ColorSpec::Kind::kSampled;
      spec.temperature_k = light.blackbody_k;
      spec.wavelengths_nm = light.wavelengths_nm;
      spec.values = light.values;
      testing::ExpectSameColor(TransformVector(color.light_from_srgb, Summed(image.sensor, spec)),
                               image.colors[i]);
    }
  }
}

// The least-squares fit leaves an error, but the balanced light looks white to every sensor.
TEST(SensorTest, BalancedLightIsNearlyWhite) {
  EXPECT_EQ(SensorNames().size(), 17u);
  ColorSpec daylight;
  daylight.kind = ColorSpec::Kind::kNamed;
  daylight.name = "stdillum-D65";
  for (const std::string& sensor : SensorNames()) {
    SCOPED_TRACE(sensor);
    const Vec3d white = Summed(sensor, daylight);
    for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(white[i], 1, 0.03);
    EXPECT_TRUE(ImageColorOf(Primaries::kSrgb, 0, sensor).AsSummed());
    EXPECT_TRUE(ImageColorOf(Primaries::kSrgb, kSensorWhiteBalanceK, sensor).AsSummed());
    EXPECT_FALSE(ImageColorOf(Primaries::kSrgb, 5000, sensor).AsSummed());
  }
  EXPECT_FALSE(IsSensor("cie1931"));
  EXPECT_FALSE(IsSensor(""));
}

}  // namespace
}  // namespace sheaf
