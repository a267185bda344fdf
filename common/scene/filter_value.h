// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What pixel filters are, as functions of one axis; the filter of a picture is the product of two.
// Sources: Mitchell and Netravali 1988; Duchon 1979 for the sinc in the window of its own middle
// (Lanczos).
#pragma once

#include "common/scene/scene_description.h"

namespace sheaf {

// At `x` radii from the centre, 0 <= x <= 1, of an axis whose radius is so many pixels; not scaled
// to any integral. Thread safety: pure.
double FilterValue(const FilterDescription& filter, double x, double radius_px);

}  // namespace sheaf
