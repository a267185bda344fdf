// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What the descriptions of scenes share: places in files, and colours as they are written.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/math/vec.h"

namespace sheaf {

inline constexpr int32_t kNone = -1;  // An index that refers to nothing.

struct SourceLocation {
  int32_t file = kNone;  // Index in SceneDescription::files.
  int32_t line = 0;      // From 1.
  int32_t column = 0;    // From 1.
};

enum class ColorRole { kReflectance, kIlluminant, kUnbounded };

// A colour as written. rgb is always filled in: the linear sRGB value that RGB transport uses,
// within the gamut of its role.
struct ColorSpec {
  enum class Kind { kRgb, kSampled, kNamed, kBlackbody };
  Kind kind = Kind::kRgb;
  Rgb rgb;
  bool is_out_of_gamut = false;  // kRgb of wider primaries: then true_rgb is the colour, in
  Rgb true_rgb;                  // linear sRGB beyond its gamut, which spectral transport keeps.
  std::vector<float> wavelengths_nm;  // kSampled.
  std::vector<float> values;          // kSampled.
  std::string name;                   // kNamed, e.g. "metal-Au-eta"; also the file of kSampled.
  float temperature_k = 0;            // kBlackbody.
};

}  // namespace sheaf
