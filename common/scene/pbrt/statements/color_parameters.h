// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Colors of pbrt files: rgb triples, blackbody temperatures, named spectra, inline samples and .spd
// files, each with its linear sRGB value filled in.
#pragma once

#include <string>

#include "common/scene/pbrt/statements/scene_files.h"
#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/scene_description.h"

namespace sheaf {

ColorSpec RgbColor(Rgb rgb);

// The color that the parameter holds, or fallback if it is absent or wrong (wrong values are
// reported).
// Requires: the parameter is not a texture.
ColorSpec GetColor(ParameterList& parameters, const std::string& name, ColorRole role,
                   const ColorSpec& fallback, SceneFiles& files);

}  // namespace sheaf
