// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/scene/enclosed_side.h"

#include <bit>

#include "common/math/mix_bits.h"

namespace sheaf {

uint64_t HashOfPoint(Vec3f p, uint64_t seed) {
  uint64_t state = seed;
  // + 0 turns -0 into 0.
  for (size_t i = 0; i < 3; ++i) {
    state = MixBits(state + std::bit_cast<uint32_t>(p[i] + 0.0f) + 0x9e3779b97f4a7c15u);
  }
  return state;
}

EnclosedSide EnclosedSideOf(const std::vector<Vec3f>& positions,
                            const std::vector<uint32_t>& indices) {
  if (indices.empty()) return EnclosedSide::kNeither;
  const Vec3d base = ToDouble(positions[indices[0]]);
  // Each directed edge adds its hash and subtracts that of its reverse: the sum is 0 if all edges
  // cancel.
  uint64_t border = 0;
  double volume = 0;
  for (size_t i = 0; i + 2 < indices.size(); i += 3) {
    const Vec3f p[3] = {positions[indices[i]], positions[indices[i + 1]],
                        positions[indices[i + 2]]};
    const uint64_t corner[3] = {HashOfPoint(p[0], 1), HashOfPoint(p[1], 1), HashOfPoint(p[2], 1)};
    for (size_t k = 0; k < 3; ++k) {
      const uint64_t a = corner[k], b = corner[(k + 1) % 3];
      border += MixBits(a + 3 * b) - MixBits(b + 3 * a);
    }
    volume += Dot(ToDouble(p[0]) - base, Cross(ToDouble(p[1]) - base, ToDouble(p[2]) - base));
  }
  if (border != 0 || volume == 0) return EnclosedSide::kNeither;
  return volume > 0 ? EnclosedSide::kBack : EnclosedSide::kFront;
}

}  // namespace sheaf
