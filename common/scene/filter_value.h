// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Pixel filters as functions of one axis; the filter of a pixel is the product of two. Sources:
// Mitchell and Netravali 1988; Duchon 1979 for the sinc windowed by its own central lobe (Lanczos).
#pragma once

#include "common/scene/scene_description.h"

namespace sheaf {

// The filter at `x` radii from the center, 0 <= x <= 1, along an axis of the given radius. Not
// normalized.
// Thread safety: pure.
double FilterValue(const FilterDescription& filter, double x, double radius_px);

}  // namespace sheaf
