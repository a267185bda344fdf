// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// From what matter gives back of light to its coefficients.
#pragma once

#include "common/scene/medium_description.h"

namespace sheaf {

// A free path of nothing would be infinitely dense.
inline constexpr float kFreePathMin = 1e-30f;

// Sets medium->reflectance, and the coefficients that follow from it as linear sRGB and from
// medium->g. Requires: the free path times its scale is at least kFreePathMin.
void SetReflectance(const MatterReflectance& reflectance, MediumDescription* medium);

}  // namespace sheaf
