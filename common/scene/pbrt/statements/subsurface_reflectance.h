// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Derives the coefficients of a subsurface medium from its reflectance.
#pragma once

#include "common/scene/medium_description.h"

namespace sheaf {

// Smallest mean free path: one of 0 would be infinitely dense.
inline constexpr float kFreePathMin = 1e-30f;

// Sets medium->reflectance, and the coefficients that follow from it and from medium->g, as linear
// sRGB.
// Requires: the free path times its scale is at least kFreePathMin.
void SetReflectance(const SubsurfaceReflectance& reflectance, MediumDescription* medium);

}  // namespace sheaf
