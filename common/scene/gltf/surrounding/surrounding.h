// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The surrounding of a glTF scene that has no lights of its own: gray below the horizon, and
// brighter towards the zenith, so that white things are seen before it, and polished ones have
// something to reflect (docs/adr/0133-a-surrounding-that-shows-white-models.md).
#pragma once

#include <string>

#include "common/math/transform.h"

namespace sheaf::gltf {

// Radiance below the horizon, and at the zenith; between, it grows with the square of the height.
inline constexpr float kHorizonRadiance = 0.2f, kZenithRadiance = 1.8f;

// The bytes of a PFM image: an equal-area map (Clarberg 2008) about +z.
std::string SurroundingMap();
// Its +z becomes +y, which is up in glTF.
Matrix4 WorldFromSurrounding();

}  // namespace sheaf::gltf
