// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightQuery: what the choice of lights at a point goes by, beside the point and its normal. A
// query that asks for several samples splits the lights there into parts (LightChoice::CutAt), and
// each part gives one sample.
//
// Each light is in at most one part, so the expected number of samples of a light is its
// probability within its part: that is the density by which multiple importance sampling weighs the
// samples, and the light where scattering hits it.
#pragma once

#include <cstdint>
#include <type_traits>

#include "worker/render/light/choice/light_visibility_row.h"
#include "worker/render/light/choice/lobe_sketch.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

// The form that code without learned visibility, or with it, reads: NoLightVisibilityRow,
// LightVisibilityRow or ProductRow.
template <typename RowT>
struct SplitLightQuery {
  using Row = RowT;
  [[no_unique_address]] Row row;
  // At most this many parts; 1: a single choice among all lights.
  uint32_t samples_max = 1;
};

// row: of the region of the point; used where KnowsLights. samples_max: used only with
// Trait::kLightSplits; at most LightChoice::kPartsMax. sketch: of the point, or null; used only
// with Trait::kLearnedLights, and for a single sample. It must outlive the query.
struct LightQuery {
  LightQuery() = default;
  LightQuery(LightVisibilityRow learned, uint32_t samples = 1)
      : row(learned), samples_max(samples) {}

  LightVisibilityRow row;
  uint32_t samples_max = 1;
  const LobeSketch* sketch = nullptr;
};

// By which one light is chosen.
template <TraitBits kTraits>
using ChoiceRowOf = std::conditional_t<Has(kTraits, Trait::kLearnedLights), ProductRow,
                                       LightVisibilityRowOf<kTraits>>;
template <TraitBits kTraits>
ChoiceRowOf<kTraits> ChoiceRowFor(const LightQuery& query) {
  if constexpr (Has(kTraits, Trait::kLearnedLights)) {
    return {query.row, query.sketch};
  } else {
    return RowFor<kTraits>(query.row);
  }
}

template <TraitBits kTraits>
using LightQueryOf =
    std::conditional_t<Has(kTraits, Trait::kLightSplits), SplitLightQuery<ChoiceRowOf<kTraits>>,
                       ChoiceRowOf<kTraits>>;
// The query, for code that is compiled for the traits.
template <TraitBits kTraits>
LightQueryOf<kTraits> QueryFor(const LightQuery& query) {
  if constexpr (Has(kTraits, Trait::kLightSplits)) {
    return {ChoiceRowFor<kTraits>(query), query.samples_max};
  } else {
    return ChoiceRowFor<kTraits>(query);
  }
}

// The row of a query for a single choice.
inline LightVisibilityRow RowOf(LightVisibilityRow row) { return row; }
inline ProductRow RowOf(ProductRow row) { return row; }
inline NoLightVisibilityRow RowOf(NoLightVisibilityRow row) { return row; }
template <typename Row>
Row RowOf(const SplitLightQuery<Row>& query) {
  return query.row;
}

}  // namespace sheaf::render
