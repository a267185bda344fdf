// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The emission of colors of vertices (COLOR_0 of unlit materials), as an image over uv of the
// mesh's own: each triangle has a square of four texels, between whose centers they are
// interpolated as over the triangle.
#pragma once

#include <cstddef>
#include <string>

#include "common/scene/gltf/meshes.h"

namespace sheaf::gltf {

// Squares of an image; triangles of the same colors share one.
inline constexpr size_t kEmissionSquaresMax = size_t{1} << 18;

// Gives each triangle vertices of its own, with uv in the image of its colors. Returns the bytes of
// the image, as PFM; empty, and the primitive unchanged, where it needs more than
// kEmissionSquaresMax squares. Requires: the primitive has colors.
std::string SeparateColors(Primitive* primitive);

}  // namespace sheaf::gltf
