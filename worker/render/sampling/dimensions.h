// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The ledger of sample dimensions. Every (path vertex, use) draws from a slot of its own, so that
// no two decisions share random numbers and a variant that skips a use shifts no other. A slot is a
// four-dimensional Owen-scrambled Sobol' point set of its own scramble. Its first two coordinates
// fill the plane best, so that u, v come first.
#pragma once

#include <cstdint>

namespace sheaf::render {

enum class CameraSlot : uint32_t {
  kFilterAndLens = 0,  // x, y of the pixel filter; u, v of the lens.
  kTime = 1,           // Shutter time.
  kWavelength = 2,     // The hero's.
  kCount = 4,
};
enum class VertexSlot : uint32_t {
  kBsdf = 0,     // u, v of the scattered direction; lobe; roulette.
  kLight = 1,    // u, v on the light; which light; spare.
  kSurface = 2,  // Mix and cut-out decisions at this vertex; two numbers of a tilted normal.
  kMedium = 3,   // How far the ray that leads here flies through media: three numbers; which of
                 // several phase functions is kBsdf's lobe.
  kCount = 4,
};
constexpr uint32_t Slot(CameraSlot use) { return static_cast<uint32_t>(use); }
// depth: 0 for the first surface the camera ray meets.
constexpr uint32_t Slot(uint32_t depth, VertexSlot use) {
  return static_cast<uint32_t>(CameraSlot::kCount) +
         depth * static_cast<uint32_t>(VertexSlot::kCount) + static_cast<uint32_t>(use);
}

// Vertices in matter count no depth, and have slots of their own: the step-th is vertex
// kMatterVertex + step. No path is as deep.
inline constexpr uint32_t kMatterVertex = 1u << 28;

// For light along the segment that leads to a vertex, in the passes-th part of that: u, v on the
// light; which light; how far along. Beyond all vertices; those 2^18 apart share slots.
constexpr uint32_t LineSlot(uint32_t vertex, uint32_t passes) {
  return (7u << 28) + ((passes & 1023u) << 18) + (vertex & 0x3ffffu);
}

// For what shines in media, as seen from a vertex: a point of a cell; which cell.
constexpr uint32_t GlowSlot(uint32_t vertex) { return (8u << 28) + (vertex & 0xfffffffu); }

}  // namespace sheaf::render
