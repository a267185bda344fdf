// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Colors as scene files give them, for tests.
#pragma once

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "common/scene/spectrum/spectrum.h"

namespace sheaf::testing {

inline ColorSpec RgbSpec(Rgb rgb) {
  ColorSpec color;
  color.rgb = rgb;
  return color;
}
inline ColorSpec Named(const std::string& name) {
  ColorSpec color;
  color.kind = ColorSpec::Kind::kNamed;
  color.name = name;
  return color;
}
inline ColorSpec BlackbodyOf(float temperature_k) {
  ColorSpec color;
  color.kind = ColorSpec::Kind::kBlackbody;
  color.temperature_k = temperature_k;
  return color;
}
inline ColorSpec Sampled(std::vector<float> wavelengths_nm, std::vector<float> values) {
  ColorSpec color;
  color.kind = ColorSpec::Kind::kSampled;
  color.wavelengths_nm = std::move(wavelengths_nm);
  color.values = std::move(values);
  return color;
}

inline void ExpectNear(Rgb a, Rgb b, float tolerance) {
  for (size_t i = 0; i < 3; ++i) EXPECT_NEAR(a[i], b[i], tolerance) << "channel " << i;
}

}  // namespace sheaf::testing
