// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The loop over the paths of a training, for the generated files that compile the variants.
#pragma once

#include "common/base/check.h"
#include "worker/render/bsdf/bsdf_inl.h"
#include "worker/render/integrator/variants.h"

namespace sheaf::render {

template <TraitBits kTraits, PathKind kPathKind>
void TrainPaths(const CompiledScene& scene, const TrainingPass& pass, const LearnedFields& fields,
                uint64_t first, uint64_t end, GuidingSink* sink, RayCounts* counts) {
  if constexpr (KnowsLights(kTraits)) {
    RayCounts local;
    local.majorant_factor = counts->majorant_factor;
    PathIntegrator<kTraits, const EmbreeScene, DirectLight::kByBoth, kPathKind> tracer(
        scene, *scene.tracer, local);
    for (uint64_t path = first; path < end; ++path) {
      tracer.TraceForTraining(pass, path, fields, sink);
    }
    counts->Add(local);
  } else {
    SHEAF_CHECK(false);
  }
}

}  // namespace sheaf::render
