// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Types that all scene descriptions share: locations in files, and colors as written.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/math/vec.h"

namespace sheaf {

inline constexpr int32_t kNone = -1;  // Refers to nothing.

struct SourceLocation {
  int32_t file = kNone;  // Index in SceneDescription::files.
  int32_t line = 0;      // From 1; 0: the file as a whole. In glTF: a node, from 1.
  int32_t column = 0;    // From 1. In glTF: a primitive of its mesh, from 1.
};

enum class ColorRole { kReflectance, kIlluminant, kUnbounded };

// A color as written. rgb is always filled in: the linear sRGB value that RGB transport uses,
// within the gamut of its role.
struct ColorSpec {
  enum class Kind { kRgb, kSampled, kNamed, kBlackbody };
  Kind kind = Kind::kRgb;
  Rgb rgb;
  bool is_out_of_gamut = false;  // kRgb in wide primaries whose color lies outside of sRGB.
  Rgb true_rgb;  // If is_out_of_gamut: that color in unclamped linear sRGB, for spectral transport.
  std::vector<float> wavelengths_nm;  // kSampled.
  std::vector<float> values;          // kSampled.
  std::string name;                   // kNamed, e.g. "metal-Au-eta"; also the file of kSampled.
  float temperature_k = 0;            // kBlackbody.
};

}  // namespace sheaf
