// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightVisibilityRow: the factors that one region of space has learned (LightVisibility), as light
// selection reads them. Each slot, a light or a child of a node of the light tree, has the fraction
// of it that is visible from the region.
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

// steps: one for each slot of the LightChoice; null where nothing is known, which gives the same
// bits as factors of 1, at no cost. Points into a LightVisibility.
struct LightVisibilityRow {
  const uint8_t* steps = nullptr;
};
// Stands for it in code that is compiled without path guiding.
struct NoLightVisibilityRow {};
template <typename Row>
inline constexpr bool kHasFactors = std::is_same_v<Row, LightVisibilityRow>;

template <uint32_t kTraits>
using LightVisibilityRowOf =
    std::conditional_t<Has(kTraits, Trait::kGuiding), LightVisibilityRow, NoLightVisibilityRow>;
// The row, for code that is compiled for the traits.
template <uint32_t kTraits>
LightVisibilityRowOf<kTraits> RowFor([[maybe_unused]] LightVisibilityRow row) {
  if constexpr (Has(kTraits, Trait::kGuiding)) {
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
