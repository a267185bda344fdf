// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The first four dimensions of Sobol's sequence for 64-bit indices, as tables that map eight bits
// of the index at a time to all four coordinates. All words are bit-reversed (the index's lowest
// bit and the coordinates' highest bit come last and first), which is the form for Owen scrambling.
// Source: Sobol' 1967; Joe and Kuo 2008, "Constructing Sobol sequences with better two-dimensional
// projections", primitive polynomials and initial numbers of new-joe-kuo-6.21201.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace sheaf::render {

inline constexpr size_t kSobolDimensionCount = 4;
inline constexpr size_t kSobolIndexBytes = 8;

// Four 32-bit coordinates, bit-reversed: bit 0 of a word is the bit of value 1/2.
struct alignas(16) SobolPoint {
  std::array<uint32_t, kSobolDimensionCount> reversed{};
};
// table[b][v]: the contribution (by exclusive or) of byte b of the index (0 is the lowest) if the
// byte, with its bits in reversed order, is v.
using SobolTable = std::array<std::array<SobolPoint, 256>, kSobolIndexBytes>;
extern const SobolTable kSobolTable;

// The point whose index is index_reversed with its 64 bits in reversed order.
inline SobolPoint SobolPointOfReversedIndex(uint64_t index_reversed) {
  SobolPoint point = kSobolTable[0][index_reversed >> 56];
  index_reversed <<= 8;
  for (size_t byte = 1; index_reversed != 0; ++byte, index_reversed <<= 8) {
    const SobolPoint& part = kSobolTable[byte][index_reversed >> 56];
    for (size_t d = 0; d < kSobolDimensionCount; ++d) point.reversed[d] ^= part.reversed[d];
  }
  return point;
}

}  // namespace sheaf::render
