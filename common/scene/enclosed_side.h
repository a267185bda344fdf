// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Whether a mesh is closed, and on which side of its triangles it encloses space.
#pragma once

#include <cstdint>
#include <vector>

#include "common/math/vec.h"

namespace sheaf {

// The side of its triangles (counter-clockwise: front) on which a mesh encloses space.
enum class EnclosedSide : uint8_t { kNeither, kBack, kFront };

// A mesh encloses where it has no border: every edge is passed as often in one direction as in the
// other. Corners are told apart by their positions, so seams of indices do not matter. One pass, no
// memory; an open mesh counts as closed with probability 2^-64.
EnclosedSide EnclosedSideOf(const std::vector<Vec3f>& positions,
                            const std::vector<uint32_t>& indices);

// The same for points that are equal, 0 and -0 among them.
uint64_t HashOfPoint(Vec3f p, uint64_t seed);

}  // namespace sheaf
