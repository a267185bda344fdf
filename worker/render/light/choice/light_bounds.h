// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightBounds: the bounds and the strength of one light, as light selection reads them.
#pragma once

#include <cstdint>

#include "common/math/vec.h"

namespace sheaf::render {

// Space: render.
struct LightBounds {
  enum class Kind : uint8_t { kPlanar, kSphere, kPoint, kInfinite };
  Kind kind = Kind::kInfinite;
  bool two_sided = true;  // kPlanar: emits on both sides.
  Vec3f center{};
  Vec3f normal{};    // kPlanar: unit, on the emitting side; kPoint: unit, the axis of its cone.
  float radius = 0;  // Bounding sphere about center.
  float area = 0;    // kPlanar: of the shape; kSphere: of its silhouette; else 0.
  // In luminance. kPlanar, kSphere: |radiance|; kPoint: |intensity|; kInfinite: the maximum
  // |irradiance| the light can give.
  float strength = 0;
  float cos_end = -1;  // kPoint: emits nothing where cos(angle to normal) < cos_end.
};

struct ChosenLight {
  uint32_t light = 0;
  float probability = 0;
};

}  // namespace sheaf::render
