// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CurveSet: thin curves with a width (hair, grass, thread), as cubic Bezier segments. A scene file
// lists each curve separately; curves that agree in all other properties are kept in one set.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/math/vec.h"

namespace sheaf {

struct CurveSet {
  // kFlat: a ribbon that faces every ray. kCylinder: the same, with the normals of a round thread.
  // kRibbon: a ribbon that faces along its normals.
  enum class Kind : uint8_t { kFlat, kCylinder, kRibbon };
  Kind kind = Kind::kFlat;
  std::vector<Vec3f> points;   // Object space, four per segment; neighbors repeat shared points.
  std::vector<float> widths;   // At the start and the end of each segment: two per segment.
  std::vector<Vec3f> normals;  // kRibbon: two per segment, unit length. Otherwise empty.

  size_t size() const { return widths.size() / 2; }
};

}  // namespace sheaf
