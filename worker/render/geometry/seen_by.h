// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RayMask: which surfaces a ray meets. A ray has one bit, a surface one for each kind of ray that
// meets it.
#pragma once

#include <cstdint>

#include "common/scene/ray_kinds.h"

namespace sheaf::render {

// The bits of RayKind, and two more.
using RayMask = uint8_t;
inline constexpr RayMask kEverything = 0xff;
// A ray that looks for the lights that a shadow ray would reach: it also meets lights that cast no
// shadow.
inline constexpr RayMask kLightSearch = 1 << 6;
// A walk beneath a surface, from which its boundary cannot be hidden.
inline constexpr RayMask kWithin = 1 << 7;

// The rays that meet a shape. bounds_inside: the shape bounds a medium or an interior: paths that
// know whether they are inside decide themselves (IsUnseen).
constexpr RayMask SeenBy(RayKinds invisible, bool is_light, bool bounds_inside) {
  if (bounds_inside) return kEverything;
  RayMask hidden = invisible;
  if (!is_light && (invisible & BitOf(RayKind::kShadow)) != 0) hidden |= kLightSearch;
  return kEverything & ~hidden;
}

}  // namespace sheaf::render
