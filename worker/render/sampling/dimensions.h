// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Allocation of sample dimensions. Every (path vertex, use) has its own slot, so that no two
// decisions share random numbers, and a variant that skips a use shifts no other. A slot is a
// four-dimensional Owen-scrambled Sobol' point set with its own scramble. The first two coordinates
// have the best 2D projection and are used for u, v.
#pragma once

#include <cstdint>

namespace sheaf::render {

enum class CameraSlot : uint32_t {
  kFilterAndLens = 0,  // x, y of the pixel filter; u, v of the lens. Light paths: the position on
                       // the light, and the direction.
  kTime = 1,           // Shutter time.
  kWavelength = 2,     // The primary wavelength.
  kEmitter = 3,        // Light paths: which light.
  kCount = 4,
};
enum class VertexSlot : uint32_t {
  kBsdf = 0,     // u, v of the scattered direction; lobe; roulette.
  kLight = 1,    // u, v on the light; which light; spare. Light paths: u, v of the lens.
  kSurface = 2,  // Mix and cut-out decisions at this vertex; two numbers for a perturbed normal.
  kMedium = 3,   // Distance sampling on the ray that leads here: three numbers. The choice among
                 // several phase functions uses kBsdf's lobe.
  kCount = 4,
};
constexpr uint32_t Slot(CameraSlot use) { return static_cast<uint32_t>(use); }
// depth: 0 for the first surface that the camera ray hits.
constexpr uint32_t Slot(uint32_t depth, VertexSlot use) {
  return static_cast<uint32_t>(CameraSlot::kCount) +
         depth * static_cast<uint32_t>(VertexSlot::kCount) + static_cast<uint32_t>(use);
}

// Vertices in subsurface media do not count towards depth, and have their own slots: step i is
// vertex kSubsurfaceVertex + i. No path is that deep.
inline constexpr uint32_t kSubsurfaceVertex = 1u << 28;

// For line sampling on the segment that leads to a vertex, in its passes-th part: u, v on the
// light; which light; position on the line. Beyond all vertices; vertices 2^18 apart share slots.
constexpr uint32_t EquiangularSlot(uint32_t vertex, uint32_t crossings) {
  return (7u << 28) + ((crossings & 1023u) << 18) + (vertex & 0x3ffffu);
}

// For sampling media emission from a vertex: a point of a cell; which cell.
constexpr uint32_t EmissionSlot(uint32_t vertex) { return (8u << 28) + (vertex & 0xfffffffu); }

// For the light sample of a part of the lights beside the first at a vertex, as kLight. part: from
// 1 to 15; vertices 2^24 apart share slots.
constexpr uint32_t LightPartSlot(uint32_t vertex, uint32_t part) {
  return (9u << 28) + ((part & 15u) << 24) + (vertex & 0xffffffu);
}

// For the number of paths that leave a vertex. Vertices 2^28 apart share slots.
constexpr uint32_t SplitSlot(uint32_t vertex) { return (10u << 28) + (vertex & 0xfffffffu); }

// For the chain from a vertex to a lamp: u, v on the lamp; which lamp; which caster. And the key of
// its further numbers. Vertices 2^27 apart share slots.
constexpr uint32_t ChainSlot(uint32_t vertex) { return (11u << 28) + (vertex & 0x7ffffffu); }
constexpr uint32_t ChainKeySlot(uint32_t vertex) { return ChainSlot(vertex) + (1u << 27); }

}  // namespace sheaf::render
