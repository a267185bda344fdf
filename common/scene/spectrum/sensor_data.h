// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Tables of measurements: the responses of camera sensors, and the reflectances by which their
// colors are balanced. sensor.h converts them to colors.
#pragma once

#include <cstddef>

namespace sheaf::sensor_data {

// Responses of red, green and blue at 380, 390 ... 720 nm, scaled so that the maximum of the three
// is 1e4. Linear in between, 0 outside. Source: measurements of Langlands and Fascione 2020
// ("PhysLight: An End-to-End Pipeline for Scene-Referred Lighting"), as published with pbrt-v4.
inline constexpr size_t kResponseSampleCount = 35;
inline constexpr double kResponseFirstNm = 380, kResponseStepNm = 10, kResponseOne = 1e4;
struct Response {
  const char* name;  // As scenes write it: "canon_eos_100d".
  int rgb[3][kResponseSampleCount];
};
inline constexpr size_t kResponseCount = 17;
extern const Response kResponses[kResponseCount];

// Reflectances of the 24 squares of a ColorChecker chart at 380, 390 ... 730 nm, in thousandths.
// Linear in between, 0 outside. Source: measurements of Pascale 2006 ("RGB coordinates of the
// Macbeth ColorChecker", BabelColor).
inline constexpr size_t kSwatchCount = 24, kSwatchSampleCount = 36;
inline constexpr double kSwatchFirstNm = 380, kSwatchStepNm = 10, kSwatchOne = 1000;
extern const int kSwatches[kSwatchCount][kSwatchSampleCount];

}  // namespace sheaf::sensor_data
