// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Determines whether a mesh is closed, and on which side of its triangles it encloses space.
#pragma once

#include <cstdint>
#include <vector>

#include "common/math/vec.h"

namespace sheaf {

// The side of its triangles (counter-clockwise: front) on which a mesh encloses space.
enum class EnclosedSide : uint8_t { kNeither, kBack, kFront };

// A mesh encloses space if it has no border: every edge is traversed equally often in both
// directions. Corners are identified by their positions, so seams of indices do not matter. One
// pass, no extra memory; an open mesh is taken for closed with probability 2^-64.
EnclosedSide EnclosedSideOf(const std::vector<Vec3f>& positions,
                            const std::vector<uint32_t>& indices);

// A hash of the point. Equal points have equal hashes; 0 and -0 are equal.
uint64_t HashOfPoint(Vec3f p, uint64_t seed);

}  // namespace sheaf
