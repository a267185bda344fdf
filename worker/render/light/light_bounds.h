// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightBounds: what choosing among lights needs to know of one.
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
  float radius = 0;  // Of a sphere about center that holds the light.
  float area = 0;    // kPlanar: the shape's; kSphere: of its outline; else 0.
  // kPlanar, kSphere: |radiance|; kPoint: |intensity|; kInfinite: the most |irradiance| it can
  // give. In luminance.
  float strength = 0;
  float cos_end = -1;  // kPoint: sends nothing along directions of a lesser cosine with normal.
};

struct ChosenLight {
  uint32_t light = 0;
  float probability = 0;
};

}  // namespace sheaf::render
