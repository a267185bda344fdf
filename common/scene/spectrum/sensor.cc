// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/spectrum/sensor.h"

#include <algorithm>
#include <cstddef>
#include <iterator>

#include "common/base/check.h"
#include "common/scene/spectrum/sensor_data.h"
#include "common/scene/spectrum/spectrum.h"

namespace sheaf {
namespace {

const sensor_data::Response* Find(const std::string& name) {
  const auto* found =
      std::find_if(std::begin(sensor_data::kResponses), std::end(sensor_data::kResponses),
                   [&](const sensor_data::Response& response) { return name == response.name; });
  return found == std::end(sensor_data::kResponses) ? nullptr : found;
}

// Linear interpolation in an equidistant table; 0 outside.
double Sampled(const int* samples, size_t count, double first_nm, double step_nm, double nm) {
  const double position = (nm - first_nm) / step_nm;
  if (position < 0 || position > static_cast<double>(count - 1)) return 0;
  const size_t below = std::min(static_cast<size_t>(position), count - 2);
  const double part = position - static_cast<double>(below);
  return samples[below] * (1 - part) + samples[below + 1] * part;
}

double SwatchAt(size_t swatch, double nm) {
  return Sampled(sensor_data::kSwatches[swatch], sensor_data::kSwatchSampleCount,
                 sensor_data::kSwatchFirstNm, sensor_data::kSwatchStepNm, nm) /
         sensor_data::kSwatchOne;
}

Vec3d ToVector(const std::array<double, 3>& values) { return {values[0], values[1], values[2]}; }

// The chart's colors as the sensor and as the observer see them.
struct Chart {
  std::array<Vec3d, sensor_data::kSwatchCount> sensor{}, srgb{};
};

Chart LookAtChart(const std::string& sensor, double white_balance_k,
                  const std::string& image_white) {
  ColorSpec white;
  white.kind = ColorSpec::Kind::kNamed;
  white.name = image_white;
  Chart chart;
  double green = 0, sensor_luminance = 0;
  for (int nm = kSpectrumFirstNm; nm <= kSpectrumLastNm; ++nm) {
    const Vec3d response = ToVector(SensorResponse(sensor, nm)),
                observer = ToVector(ObserverRgb(nm));
    const double sensor_light = LightOfTemperature(white_balance_k, nm);
    const double image_light = EvaluateSpectrum(white, nm);
    green += response.y * sensor_light;
    sensor_luminance += LuminousEfficiency(nm) * sensor_light;
    for (size_t i = 0; i < sensor_data::kSwatchCount; ++i) {
      const double reflectance = SwatchAt(i, nm);
      chart.sensor[i] = chart.sensor[i] + response * (reflectance * sensor_light);
      chart.srgb[i] = chart.srgb[i] + observer * (reflectance * image_light);
    }
  }
  // The scale of white: green responds 1, and the observer sees the luminance that the sensor needs
  // for that.
  const double luminance = sensor_luminance / green / SpectrumLuminance(white);
  for (size_t i = 0; i < sensor_data::kSwatchCount; ++i) {
    chart.sensor[i] = chart.sensor[i] / green;
    chart.srgb[i] = chart.srgb[i] * luminance;
  }
  return chart;
}

}  // namespace

bool IsSensor(const std::string& name) { return Find(name) != nullptr; }

std::vector<std::string> SensorNames() {
  std::vector<std::string> names;
  for (const sensor_data::Response& response : sensor_data::kResponses)
    names.emplace_back(response.name);
  return names;
}

std::array<double, 3> SensorResponse(const std::string& sensor, double wavelength_nm) {
  const sensor_data::Response* response = Find(sensor);
  SHEAF_CHECK(response != nullptr);
  std::array<double, 3> values{};
  for (size_t i = 0; i < 3; ++i) {
    values[i] =
        Sampled(response->rgb[i], sensor_data::kResponseSampleCount, sensor_data::kResponseFirstNm,
                sensor_data::kResponseStepNm, wavelength_nm) /
        sensor_data::kResponseOne;
  }
  return values;
}

Matrix4 SrgbFromSensor(const std::string& sensor, double white_balance_k,
                       const std::string& image_white) {
  // Least squares by the normal equations: srgb sensor^T (sensor sensor^T)^-1.
  const Chart chart = LookAtChart(sensor, white_balance_k, image_white);
  Matrix4 products, squares;
  for (size_t row = 0; row < 3; ++row) {
    for (size_t column = 0; column < 3; ++column) {
      products.m[row][column] = squares.m[row][column] = 0;
      for (size_t i = 0; i < sensor_data::kSwatchCount; ++i) {
        products.m[row][column] += chart.srgb[i][row] * chart.sensor[i][column];
        squares.m[row][column] += chart.sensor[i][row] * chart.sensor[i][column];
      }
    }
  }
  Matrix4 inverse;
  SHEAF_CHECK(Invert(squares, &inverse));
  return products * inverse;
}

Matrix4 SummedFromSensor(const std::string& sensor) {
  return SrgbFromSensor(sensor, static_cast<double>(kSensorWhiteBalanceK), "stdillum-D65");
}

}  // namespace sheaf
