// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Limits on the length of paths, and the parameters of Russian roulette.
#pragma once

#include <cstdint>

namespace sheaf::render {

// Null-interface crossings (cut-outs, interfaces) do not count as scattering; a path with more than
// this number in one segment ends and is counted, so that no scene can block a worker.
inline constexpr uint32_t kNullCrossingsMax = 1u << 16;
// Maximum number of vertices of a path in a subsurface medium; a path with more ends and is
// counted. In a half space without absorption one in a thousand paths exceeds it.
inline constexpr uint32_t kSubsurfaceStepsMax = 1u << 20;
// Roulette starts after this number of scattering events, and ends a path with at most this
// probability.
inline constexpr uint32_t kRouletteDepthMin = 1;
inline constexpr float kRouletteStopMax = 0.95f;

}  // namespace sheaf::render
