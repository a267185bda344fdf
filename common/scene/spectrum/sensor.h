// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sensors of cameras, as pbrt-v4 has them: three responses to each wavelength instead of the CIE
// observer's, and the matrix that makes colors of them. The matrix is the one that, for the squares
// of a ColorChecker chart, comes nearest to what the observer sees: the sensor looks at them under
// the light that the white balance names, the observer under the white of the picture's primaries.
// Both whites have the same luminance. Source: Langlands and Fascione 2020, "PhysLight"; Pharr,
// Jakob and Humphreys 2023, "Physically Based Rendering", 5.4.2. See docs/adr/0049.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "common/math/transform.h"

namespace sheaf {

// Temperature of the light that a sensor's picture shows as white unless a scene says another.
inline constexpr float kSensorWhiteBalanceK = 6500;

// Names as scenes write them: "canon_eos_100d" ... "cie1931", which stands for no sensor, is none.
bool IsSensor(const std::string& name);
std::vector<std::string> SensorNames();

// The responses of red, green and blue to a wavelength. Requires: IsSensor(sensor).
std::array<double, 3> SensorResponse(const std::string& sensor, double wavelength_nm);
// Linear sRGB of the three responses to spectral radiance, integrated as ObserverRgb's are.
// picture_white: name of the spectrum that the picture shows as white. Requires: IsSensor(sensor);
// IsNamedSpectrum(picture_white).
Matrix4 SrgbFromSensor(const std::string& sensor, double white_balance_k,
                       const std::string& picture_white);
// The same as the film sums it, whatever is delivered: balanced from kSensorWhiteBalanceK to D65.
Matrix4 SummedFromSensor(const std::string& sensor);

}  // namespace sheaf
