// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Colors of image files whose header gives primaries, as linear sRGB.
#pragma once

#include <array>
#include <optional>
#include <string>

#include "common/math/transform.h"
#include "common/math/vec.h"
#include "common/scene/color_spec.h"

namespace sheaf::render {

// The matrix to linear sRGB from the primaries of a file: FloatImage::chromaticities or those of a
// TextureImage. White keeps its color for kIlluminant, and stays (1, 1, 1) for all other roles, as
// SrgbFromPrimaries has it. None where the file gives no primaries or those of sRGB. Warns of
// primaries that define no color, and takes them as those of sRGB. file: names it in the warning.
std::optional<Matrix4> SrgbFromFile(const std::optional<std::array<float, 8>>& chromaticities,
                                    ColorRole role, const std::string& file);

// Returns false where a nonnegative color gets a negative component, which is clamped to 0. Ignores
// rounding of colors on the gamut's boundary.
bool MoveToSrgb(const Matrix4& srgb_from_file, Rgb* color);

}  // namespace sheaf::render
