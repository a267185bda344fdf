// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightDraw: the numbers that sample a light at a vertex, and the part of the work that needs only
// them. It may start before the vertex is known, so that memory is read meanwhile.
#pragma once

#include <array>
#include <cstdint>

#include "worker/render/integrator/context.h"

namespace sheaf::render {

struct LightDraw {
  std::array<float, 4> u;
  LightTable::Preparation preparation;
};

// vertex: its index for sample dimensions.
template <typename C>
LightDraw DrawLight(const Context<C>& c, uint32_t vertex) {
  LightDraw draw{c.sampler.Get4(Slot(vertex, VertexSlot::kLight)), {}};
  draw.preparation = c.scene.lights->template PrepareSample<C::kTraits>({draw.u[0], draw.u[1]});
  return draw;
}

}  // namespace sheaf::render
