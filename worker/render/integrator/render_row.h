// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The loop over one row of pixels, for the generated files that compile the variants.
#pragma once

#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/integrator/variants.h"

namespace sheaf::render {

// The same samples, with the other outputs that the scene's settings request.
template <typename Tracer>
void RenderRowWithOutputs(const CompiledScene& scene, int32_t x0, int32_t x1, int32_t y,
                          SampleBlock block, Tracer* tracer, PixelAccumulator* accumulator) {
  OutputSample outputs(scene.settings.outputs);
  tracer->set_outputs(&outputs);
  for (int32_t x = x0; x < x1; ++x) {
    accumulator->Begin(x, y);
    for (uint64_t s = block.first; s < block.End(); ++s) {
      outputs.Clear();
      const FilmSample sample = tracer->TraceSample(x, y, s);
      accumulator->Add(s, sample, outputs);
    }
    accumulator->End();
  }
}

template <TraitBits kTraits, PathKind kPathKind>
void RenderRow(const CompiledScene& scene, int32_t x0, int32_t x1, int32_t y, SampleBlock block,
               PixelAccumulator* accumulator, RayCounts* counts) {
  RayCounts local;
  local.majorant_factor = counts->majorant_factor;
  PathIntegrator<kTraits, const EmbreeScene, DirectLight::kByBoth, kPathKind> tracer(
      scene, *scene.tracer, local);
  if (Has(kTraits, Trait::kOutputs) && !scene.settings.outputs.empty()) {
    RenderRowWithOutputs(scene, x0, x1, y, block, &tracer, accumulator);
  } else {
    for (int32_t x = x0; x < x1; ++x) {
      accumulator->Begin(x, y);
      for (uint64_t s = block.first; s < block.End(); ++s) {
        accumulator->Add(s, tracer.TraceSample(x, y, s));
      }
      accumulator->End();
    }
  }
  counts->Add(local);
}

}  // namespace sheaf::render
