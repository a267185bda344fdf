// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Splits a grid of colors into grids of numbers: the common part of the components is gray, and the
// rest belongs to red, green or blue light. A medium with a grid of colors then becomes several
// overlapping media of one color each, which add up.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "worker/render/color/spectral_color.h"
#include "worker/render/color/wavelengths.h"

namespace sheaf::render {

enum class ColorPart : uint8_t { kGray, kRed, kGreen, kBlue };
inline constexpr size_t kColorPartCount = 4;
// Maximum number per medium: parts that absorb and parts that scatter.
inline constexpr size_t kMediumPartsMax = 2 * kColorPartCount;

// The amount of each part, one number per cell; empty where a part is zero everywhere. Their
// trilinear interpolants sum to that of the colors. Requires: no component is negative.
std::array<std::vector<float>, kColorPartCount> SplitColors(const std::vector<Rgb>& cells);

// The light that a part affects: for an RGB component all or nothing; for a wavelength a fraction,
// the reflectance of the sRGB primary there. Red, green and blue sum to gray.
template <typename Color>
Color PartWeight(ColorPart part, const WavelengthsOf<Color>& wavelengths);

}  // namespace sheaf::render
