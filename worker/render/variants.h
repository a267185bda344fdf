// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The compiled variants of the path tracer and the choice among them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/film/film_tile.h"
#include "common/film/tile_geometry.h"
#include "worker/render/path_tracer.h"

namespace sheaf::render {

// Renders the block of samples of pixels [x0, x1) of row y.
using RenderRowFunction = void (*)(const CompiledScene& scene, int32_t x0, int32_t x1, int32_t y,
                                   SampleBlock block, PixelAccumulator* accumulator,
                                   RayCounts* counts);
struct Variant {
  std::string name;
  uint32_t traits = 0;
};

// All of variant_list.h, in its order.
std::vector<Variant> AllVariants();
// Index of the variant that has all of `traits` and carries the cheapest others: the fewest of
// kPaidByEveryPath, then the fewest.
size_t ChooseVariant(uint32_t traits, bool force_generic);
RenderRowFunction RowFunctionOf(size_t variant);

// Defined once for each variant, in generated files.
template <uint32_t kTraits>
void RenderRow(const CompiledScene& scene, int32_t x0, int32_t x1, int32_t y, SampleBlock block,
               PixelAccumulator* accumulator, RayCounts* counts);

}  // namespace sheaf::render
