// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/sampling/sobol_points.h"

namespace sheaf::render {
namespace {

constexpr size_t kIndexBits = 64;
using DirectionNumbers = std::array<uint64_t, kIndexBits>;

constexpr uint32_t ReverseBits(uint32_t v) {
  uint32_t reversed = 0;
  for (int bit = 0; bit < 32; ++bit) reversed |= ((v >> bit) & 1u) << (31 - bit);
  return reversed;
}

// One line of the Joe-Kuo table: a polynomial of this degree, its inner coefficients as bits, and
// the first direction integers m_1 .. m_degree.
struct PolynomialLine {
  size_t degree;
  uint32_t coefficients;
  std::array<uint64_t, 3> m;
};
constexpr std::array<PolynomialLine, kSobolDimensionCount - 1> kJoeKuo{{
    {1, 0, {1, 0, 0}},
    {2, 1, {1, 3, 0}},
    {3, 1, {1, 3, 1}},
}};

// Direction numbers as 64-bit fractions. The recurrence uses all 64 bits of the index, so that
// points with large indices continue the same infinite sequence.
constexpr DirectionNumbers MakeDirectionNumbers(const PolynomialLine& line) {
  DirectionNumbers v{};
  for (size_t i = 0; i < line.degree; ++i) v[i] = line.m[i] << (kIndexBits - 1 - i);
  for (size_t i = line.degree; i < kIndexBits; ++i) {
    v[i] = v[i - line.degree] ^ (v[i - line.degree] >> line.degree);
    for (size_t k = 1; k < line.degree; ++k) {
      if ((line.coefficients >> (line.degree - 1 - k)) & 1u) v[i] ^= v[i - k];
    }
  }
  return v;
}

constexpr std::array<DirectionNumbers, kSobolDimensionCount> MakeAllDirectionNumbers() {
  std::array<DirectionNumbers, kSobolDimensionCount> all{};
  for (size_t i = 0; i < kIndexBits; ++i) all[0][i] = uint64_t{1} << (kIndexBits - 1 - i);
  for (size_t d = 1; d < kSobolDimensionCount; ++d) all[d] = MakeDirectionNumbers(kJoeKuo[d - 1]);
  return all;
}

constexpr SobolTable MakeSobolTable() {
  constexpr std::array<DirectionNumbers, kSobolDimensionCount> kDirections =
      MakeAllDirectionNumbers();
  SobolTable table{};
  for (size_t byte = 0; byte < kSobolIndexBytes; ++byte) {
    for (size_t d = 0; d < kSobolDimensionCount; ++d) {
      // Entry v differs from an earlier one by its highest set bit, and bit 7 - i of the reversed
      // byte is bit i of the index.
      for (size_t bit = 0; bit < 8; ++bit) {
        const uint64_t direction = kDirections[d][byte * 8 + (7 - bit)];
        const uint32_t reversed = ReverseBits(static_cast<uint32_t>(direction >> 32));
        const size_t first = size_t{1} << bit;
        for (size_t v = 0; v < first; ++v) {
          table[byte][first + v].reversed[d] = table[byte][v].reversed[d] ^ reversed;
        }
      }
    }
  }
  return table;
}

}  // namespace

constinit const SobolTable kSobolTable = MakeSobolTable();

}  // namespace sheaf::render
