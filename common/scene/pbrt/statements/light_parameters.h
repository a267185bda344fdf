// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Lights of pbrt files: LightSource and AreaLightSource, with pbrt-v4's defaults.
#pragma once

#include <optional>
#include <string>

#include "common/scene/pbrt/statements/scene_files.h"
#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// LightSource "type" ...; empty (reported) if Sheaf does not support the type.
std::optional<LightDescription> GetLight(const std::string& type, const Matrix4& world_from_light,
                                         ParameterList& parameters, SceneFiles& files);

// AreaLightSource "diffuse" ...
std::optional<AreaLightDescription> GetAreaLight(const std::string& type, ParameterList& parameters,
                                                 SceneFiles& files);

}  // namespace sheaf
