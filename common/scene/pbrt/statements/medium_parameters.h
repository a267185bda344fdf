// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Media of pbrt files: what MakeNamedMedium says, after pbrt-v4's defaults.
#pragma once

#include <string>

#include "common/scene/file_source.h"
#include "common/scene/pbrt/syntax/parameter_list.h"
#include "common/scene/scene_description.h"

namespace sheaf {

// A grid has at most this many cells along each side, and in all.
inline constexpr int32_t kGridSideMax = 1 << 14;
inline constexpr int64_t kGridCellsMax = int64_t{1} << 30;

// MakeNamedMedium "name" ... False (reported) where Sheaf does not do the type; other mistakes are
// reported and the default takes their place.
bool SetMedium(const Matrix4& world_from_medium, ParameterList& parameters, FileSource& files,
               MediumDescription* medium);

// Reports coefficients that no matter has, and makes them 0.
void RequireCoefficient(ParameterList& parameters, const std::string& name, ColorSpec* color);
// "scale" and "g", which every type has.
void GetScaleAndPhase(ParameterList& parameters, MediumDescription* medium);

// Substances that "string preset" may name: reduced scattering and absorption per millimetre, as
// linear sRGB. Sources: Jensen et al. 2001, "A Practical Model for Subsurface Light Transport",
// table of section 5; Narasimhan et al. 2006, "Acquiring Scattering Properties of Participating
// Media by Dilution", table 4; under the names that pbrt-v4 gives them.
struct MeasuredMedium {
  const char* name;
  Rgb sigma_s, sigma_a;
};
// Null where there is none of this name.
const MeasuredMedium* FindMeasuredMedium(const std::string& name);
std::vector<std::string> MeasuredMediumNames();

}  // namespace sheaf
