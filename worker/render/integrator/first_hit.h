// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// What FilmOutputs records of the first surface that a camera ray meets. That is the first one
// which light does not just pass: through glass it is the glass, a cut-out's holes are none. Where
// a medium scatters the ray before, it is the place in the medium.
#pragma once

#include "common/film/film_outputs.h"
#include "worker/render/geometry/surface_point.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {

// point: where `ray` of the camera met the surface. Writes every AOV that the settings ask for.
void RecordFirstHit(const CompiledScene& scene, const Ray& ray, const SurfacePoint& point,
                    OutputSample* outputs);

// The same where the first event is in a medium, at p: there is a position, its motion is the
// camera's, and there is no surface to tell of.
void RecordFirstEventInMedium(const CompiledScene& scene, const Ray& ray, Vec3f p,
                              OutputSample* outputs);

}  // namespace sheaf::render
