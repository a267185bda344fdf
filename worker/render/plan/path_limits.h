// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Where paths end that would go on for too long, and from where on chance may end them.
#pragma once

#include <cstdint>

namespace sheaf::render {

// Surfaces that let a ray pass (cut-outs, interfaces) do not count as scattering; beyond this many
// in one segment the path ends, so that no arrangement of them can hold a worker.
inline constexpr uint32_t kPassesMax = 1024;
// Vertices of a path in matter; one that has more ends and is counted. Of paths into a half space
// that absorbs nothing a thousandth has more.
inline constexpr uint32_t kMatterStepsMax = 1u << 20;
// Roulette starts after this many scattering events and ends a path with at most this probability.
inline constexpr uint32_t kRouletteDepthMin = 1;
inline constexpr float kRouletteStopMax = 0.95f;

}  // namespace sheaf::render
