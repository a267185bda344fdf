// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Responses of camera sensors to lights by pbrt-v4's documented model (Physically Based Rendering,
// 4th edition, 5.4.2). The expected colors were integrated independently of Sheaf in steps of 1 nm,
// from the CIE's tables of 1 nm, the illuminants as tabulated by pbrt-v4 and the published sensor
// curves.
#pragma once

#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "common/math/vec.h"
#include "common/scene/scene_description.h"
#include "gtest/gtest.h"

namespace sheaf::testing {

// Lights, each of luminance 1.
struct SensorLight {
  const char* name;
  const char* parameter;  // As written in a scene file after "spectrum L" or "blackbody L".
  float blackbody_k;      // 0: given by wavelengths and values.
  std::vector<float> wavelengths_nm, values;
};
inline const std::vector<SensorLight>& SensorLights() {
  static const std::vector<SensorLight> lights = {
      {"blackbody", "\"blackbody L\" 2856", 2856, {}, {}},
      {"flat", "\"spectrum L\" [360 1 830 1]", 0, {360, 830}, {1, 1}},
      {"red", "\"spectrum L\" [360 0 580 0 620 1 830 1]", 0, {360, 580, 620, 830}, {0, 0, 1, 1}},
      {"green",
       "\"spectrum L\" [360 0 500 0 540 1 580 0 830 0]",
       0,
       {360, 500, 540, 580, 830},
       {0, 0, 1, 0, 0}},
      {"blue", "\"spectrum L\" [360 1 460 1 510 0 830 0]", 0, {360, 460, 510, 830}, {1, 1, 0, 0}},
  };
  return lights;
}

struct SensorImage {
  const char* sensor;
  float white_balance_k;  // As in scene files; 0: not given.
  const char* color_space;
  Primaries primaries;
  std::array<Vec3d, 5> colors;  // For each of SensorLights.
};
inline const std::vector<SensorImage>& SensorImages() {
  static const std::vector<SensorImage> images = {
      {"canon_eos_100d",
       0,
       "srgb",
       Primaries::kSrgb,
       {{{1.8707, 0.8466, 0.2526},
         {1.1947, 0.9390, 0.9064},
         {5.4854, -0.0110, 0.0504},
         {-0.2420, 1.4134, -0.2289},
         {-0.5850, -2.2759, 20.7264}}}},
      {"nikon_d850",
       5000,
       "srgb",
       Primaries::kSrgb,
       {{{1.6112, 0.8600, 0.3765},
         {0.9819, 0.9640, 1.1629},
         {4.8915, -0.0677, 0.1644},
         {-0.3029, 1.5052, -0.3031},
         {-2.1562, -2.3962, 25.0662}}}},
      {"sony_ilce_7m3",
       3200,
       "srgb",
       Primaries::kSrgb,
       {{{1.1139, 0.9586, 0.7655},
         {0.5164, 1.0803, 2.3227},
         {3.6912, -0.1311, 0.1404},
         {-0.3155, 1.7757, -0.2936},
         {-5.3157, -2.2007, 48.0284}}}},
      {"canon_eos_5d_mkiv",
       0,
       "aces2065-1",
       Primaries::kAces2065,
       {{{1.1973, 0.8865, 0.3563},
         {1.0463, 0.9611, 0.8952},
         {2.4274, 0.5201, 0.1759},
         {0.3565, 1.0754, -0.0626},
         {2.6229, -0.0219, 17.1763}}}},
  };
  return images;
}

// Every channel that is at least a tenth of the largest must be within 2 % of its expected value,
// and all channels within 1 % of the largest.
inline void ExpectSameColor(Vec3d color, Vec3d expected) {
  double largest = 0;
  for (size_t i = 0; i < 3; ++i) largest = std::fmax(largest, std::fabs(expected[i]));
  for (size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(color[i], expected[i], 0.01 * largest) << "channel " << i;
    if (std::fabs(expected[i]) < 0.1 * largest) continue;
    EXPECT_NEAR(color[i] / expected[i], 1, 0.02) << "channel " << i;
  }
}

}  // namespace sheaf::testing
