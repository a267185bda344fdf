// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RecordFirstHit: the FilmOutputs of the first surface that a camera ray hits. Null interfaces and
// the holes of cut-outs do not count, but glass does. If a medium scatters the ray before, the
// record is of the position in the medium.
#pragma once

#include "common/film/film_outputs.h"
#include "worker/render/geometry/surface_point.h"
#include "worker/render/scene/compiled_scene.h"

namespace sheaf::render {

// point: the hit of the camera ray `ray`. Writes every AOV that the settings request.
void RecordFirstHit(const CompiledScene& scene, const Ray& ray, const SurfacePoint& point,
                    OutputSample* outputs);

// The same where the first event is in a medium, at p: it has a position, whose motion is the
// camera's, and no surface properties.
void RecordFirstEventInMedium(const CompiledScene& scene, const Ray& ray, Vec3f p,
                              OutputSample* outputs);

}  // namespace sheaf::render
