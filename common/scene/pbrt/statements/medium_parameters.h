// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Media of pbrt files: MakeNamedMedium, with pbrt-v4's defaults.
#pragma once

#include <string>

#include "common/scene/pbrt/statements/scene_files.h"
#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// Maximum number of cells of a grid along each side, and in total.
inline constexpr int32_t kGridSideMax = 1 << 14;
inline constexpr int64_t kGridCellsMax = int64_t{1} << 30;

// MakeNamedMedium "name" ... False (reported) if Sheaf does not support the type; other mistakes
// are reported and replaced by the default.
bool SetMedium(const Matrix4& world_from_medium, ParameterList& parameters, SceneFiles& files,
               MediumDescription* medium);

// Reports physically impossible coefficients, and sets them to 0.
void RequireCoefficient(ParameterList& parameters, const std::string& name, ColorSpec* color);
// Reads "scale" and "g", which every type has.
void GetScaleAndPhase(ParameterList& parameters, MediumDescription* medium);

// Substances that "string preset" may name: reduced scattering and absorption per millimeter, as
// linear sRGB. Sources: Jensen et al. 2001, "A Practical Model for Subsurface Light Transport",
// table of section 5; Narasimhan et al. 2006, "Acquiring Scattering Properties of Participating
// Media by Dilution", table 4; under pbrt-v4's names.
struct MeasuredMedium {
  const char* name;
  Rgb sigma_s, sigma_a;
};
// Null if there is none of this name.
const MeasuredMedium* FindMeasuredMedium(const std::string& name);
std::vector<std::string> MeasuredMediumNames();

}  // namespace sheaf
