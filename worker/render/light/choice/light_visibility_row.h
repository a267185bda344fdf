// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightVisibilityRow: the factors that one region of space has learned (LightVisibility), as light
// selection reads them. Each slot, a light or a child of a node of the light tree, has a factor:
// how much of it is visible from the region, or how much comes from it against the estimate.
//
// Slots are in blocks of kLaneCount, each for as many lights or for the children of a node. Rows of
// one form have a block for each of the first nodes of the tree, in their order. A cut has blocks
// for nodes of the region's own choice, from the root down, with links from each to those below.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <type_traits>

#include "common/math/lanes.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

// A factor is (step + 1) / kVisibilitySteps: one byte a slot, and exact in float. 1 where nothing
// was tried.
inline constexpr int kVisibilitySteps = 256;
inline constexpr uint8_t kVisibilityStepOfOne = kVisibilitySteps - 1;
// The step of the least factor, 1/16: where the statistics are wrong, a light keeps this part of
// its weight.
inline constexpr uint8_t kVisibilityStepMin = kVisibilitySteps / 16 - 1;

// Blocks of the first nodes, and of a cut with the step of all infinite lights behind them.
inline constexpr uint32_t kFirstNodeBlocks = 16, kCutBlocks = 8;
inline constexpr size_t kCutSlots = kCutBlocks * kLaneCount;
// A link to no block: nothing is known of the node's children.
inline constexpr uint8_t kNoBlock = 255;

// steps: one for each slot of the LightChoice; null where nothing is known, which gives the same
// bits as factors of 1, at no cost. links: null, or those of a cut, the block below each of
// kCutSlots slots. Point into a LightVisibility.
struct LightVisibilityRow {
  const uint8_t* steps = nullptr;
  const uint8_t* links = nullptr;

  // The block of the children of `node`, which is below the slot `place` of `block`; at least
  // kFirstNodeBlocks where none is. The root's is 0.
  uint32_t BlockBelow(uint32_t block, size_t place, uint32_t node) const {
    if (links == nullptr) return node;
    return block < kCutBlocks ? links[block * kLaneCount + place] : uint32_t{kNoBlock};
  }
};
// Stands for it in code that is compiled without path guiding and learned lights.
struct NoLightVisibilityRow {
  static uint32_t BlockBelow(uint32_t, size_t, uint32_t) { return kNoBlock; }
};
template <typename Row>
inline constexpr bool kHasFactors = std::is_base_of_v<LightVisibilityRow, Row>;

template <TraitBits kTraits>
using LightVisibilityRowOf =
    std::conditional_t<KnowsLights(kTraits), LightVisibilityRow, NoLightVisibilityRow>;
// The row, for code that is compiled for the traits.
template <TraitBits kTraits>
LightVisibilityRowOf<kTraits> RowFor([[maybe_unused]] LightVisibilityRow row) {
  if constexpr (KnowsLights(kTraits)) {
    return row;
  } else {
    return {};
  }
}

// The factors of kLaneCount slots in a row. Requires: row.steps is not null.
inline Lanes VisibilityFactors(LightVisibilityRow row, size_t first_slot) {
  using ByteLanes = uint8_t __attribute__((vector_size(kLaneCount)));
  ByteLanes steps;
  std::memcpy(&steps, row.steps + first_slot, sizeof(steps));
  return (1 + __builtin_convertvector(steps, Lanes)) * (1.0f / kVisibilitySteps);
}
inline float VisibilityFactor(LightVisibilityRow row, size_t slot) {
  return (1 + static_cast<float>(row.steps[slot])) * (1.0f / kVisibilitySteps);
}

}  // namespace sheaf::render
