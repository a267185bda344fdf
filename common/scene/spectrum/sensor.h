// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Camera sensors, as in pbrt-v4: three responses to each wavelength instead of the CIE observer's,
// and the matrix that converts them to colors. The matrix minimizes, over the squares of a
// ColorChecker chart, the difference to the colors that the observer sees: the sensor sees the
// squares under the light that the white balance names, the observer under the white of the image's
// primaries. Both whites have the same luminance. Source: Langlands and Fascione 2020, "PhysLight";
// Pharr, Jakob and Humphreys 2023, "Physically Based Rendering", 5.4.2. See docs/adr/0049.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "common/math/transform.h"

namespace sheaf {

// Temperature of the light that looks white in a sensor's image unless the scene sets another.
inline constexpr float kSensorWhiteBalanceK = 6500;

// Names as scenes write them: "canon_eos_100d" ... "cie1931" means no sensor and is not one.
bool IsSensor(const std::string& name);
std::vector<std::string> SensorNames();

// Responses of red, green and blue at a wavelength. Requires: IsSensor(sensor).
std::array<double, 3> SensorResponse(const std::string& sensor, double wavelength_nm);
// Linear sRGB of the three responses to spectral radiance, integrated like ObserverRgb's.
// image_white: name of the spectrum that looks white in the image.
// Requires: IsSensor(sensor); IsNamedSpectrum(image_white).
Matrix4 SrgbFromSensor(const std::string& sensor, double white_balance_k,
                       const std::string& image_white);
// The matrix by which the film sums responses, for all deliveries: balanced from
// kSensorWhiteBalanceK to D65.
Matrix4 SummedFromSensor(const std::string& sensor);

}  // namespace sheaf
