// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ReadLights: reads the lights of a scene file, with their images, into render space. Units and the
// meaning of `power` and `illuminance` are pbrt-v4's.
#pragma once

#include "absl/status/status.h"
#include "common/math/vec.h"
#include "common/scene/file_source.h"
#include "common/scene/scene_description.h"
#include "worker/render/light/light_table_impl.h"

namespace sheaf::render {

// Appends the lights of the scene to impl, except those that are black. Errors: those of
// LightTable::Build; stops at the first.
absl::Status ReadLights(const SceneDescription& scene, Vec3d render_origin_world, bool spectral,
                        FileSource& files, LightTable::Impl* impl);

}  // namespace sheaf::render
