// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Grids of colours as sums of grids of numbers: what the components of a colour have in common is
// grey, what is left belongs to red, green or blue light. A medium that is a grid of colours is
// then so many media of one colour each in one place, and media in one place add up.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "worker/render/color/spectral_color.h"
#include "worker/render/color/wavelengths.h"

namespace sheaf::render {

enum class ColorPart : uint8_t { kGrey, kRed, kGreen, kBlue };
inline constexpr size_t kColorPartCount = 4;
// Of a medium: those that absorb and those that scatter.
inline constexpr size_t kMediumPartsMax = 2 * kColorPartCount;

// The amount of each part, one number a cell; empty where a part is nowhere. Their trilinear
// interpolants add up to that of the colours. Requires: no component is negative.
std::array<std::vector<float>, kColorPartCount> SplitColors(const std::vector<Rgb>& cells);

// The light that a part is about: of a component of RGB all or nothing; of a wavelength a share, by
// what the primaries of sRGB reflect there. Red, green and blue add up to grey.
template <typename Color>
Color ShareOf(ColorPart part, const WavelengthsOf<Color>& wavelengths);

}  // namespace sheaf::render
