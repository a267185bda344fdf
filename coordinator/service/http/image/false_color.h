// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Maps numbers to colors by the color map "viridis": its steps look equally large, also in
// grayscale and to color-blind people.
#pragma once

#include "common/image/image_io.h"

namespace sheaf::coordinator {

// The color of `t`, from dark blue at 0 to yellow at 1. `t` is clamped to [0, 1]; NaN counts as 0.
// Source: S. van der Walt and N. Smith, matplotlib's color map viridis (CC0), 2015, as the
// polynomial of degree 6 fitted by M. Zucker, https://www.shadertoy.com/view/WlfXRN (CC0), 2019.
// It is within 4 of 255 levels of the map.
Rgb8 Viridis(double t);

}  // namespace sheaf::coordinator
