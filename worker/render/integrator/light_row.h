// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The loop over the light paths of one row, for the generated files that compile the variants.
#pragma once

#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/integrator/light_path.h"
#include "worker/render/integrator/variants.h"

namespace sheaf::render {

template <uint32_t kTraits>
void TraceLightRow(const CompiledScene& scene, int32_t x0, int32_t x1, int32_t y, uint64_t pass,
                   const GatherMap* map, SplatSink* splats, RayCounts* counts) {
  RayCounts local;
  local.majorant_factor = counts->majorant_factor;
  LightPathIntegrator<kTraits, const EmbreeScene> tracer(scene, *scene.tracer, local);
  for (int32_t x = x0; x < x1; ++x) tracer.TracePath(x, y, pass, map, splats);
  counts->Add(local);
}

}  // namespace sheaf::render
