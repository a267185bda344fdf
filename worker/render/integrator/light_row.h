// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The loops over the light paths of one row, and of a training, for the generated files that
// compile the variants.
#pragma once

#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/integrator/light_path.h"
#include "worker/render/integrator/variants.h"

namespace sheaf::render {

template <TraitBits kTraits>
void TraceLightRow(const CompiledScene& scene, int32_t x0, int32_t x1, int32_t y, uint64_t pass,
                   const GatherMap* map, SplatSink* splats, RayCounts* counts) {
  RayCounts local;
  local.majorant_factor = counts->majorant_factor;
  LightPathIntegrator<kTraits, const EmbreeScene> tracer(scene, *scene.tracer, local);
  for (int32_t x = x0; x < x1; ++x) tracer.TracePath(x, y, pass, map, splats);
  counts->Add(local);
}

template <TraitBits kTraits>
void TrainLightPaths(const CompiledScene& scene, const TrainingPass& pass,
                     const LearnedFields& fields, uint64_t first, uint64_t end,
                     EmissionStatistics* statistics, RayCounts* counts) {
  RayCounts local;
  local.majorant_factor = counts->majorant_factor;
  LightPathIntegrator<kTraits, const EmbreeScene> tracer(scene, *scene.tracer, local);
  for (uint64_t path = first; path < end; ++path) {
    tracer.TraceForTraining(pass, path, fields, statistics);
  }
  counts->Add(local);
}

}  // namespace sheaf::render
