// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What FilmOutputs records of the first surface that a camera ray meets. That is the first one
// which light does not just pass: through glass it is the glass, a cut-out's holes are none.
#pragma once

#include "common/film/film_outputs.h"
#include "worker/render/compiled_scene.h"
#include "worker/render/surface_point.h"

namespace sheaf::render {

// point: where `ray` of the camera met the surface. Writes every AOV that the settings ask for.
void RecordFirstHit(const CompiledScene& scene, const Ray& ray, const SurfacePoint& point,
                    OutputSample* outputs);

}  // namespace sheaf::render
