// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The techniques among which `--techniques auto` chooses: MeasureTechniques and MeasureSharing
// render no others, and FormatTechniqueChoices lists these.
#pragma once

#include <string>

#include "common/scene/settings/techniques.h"

namespace sheaf::render {

inline constexpr TechniqueSet kPlainChoices[] = {
    TechniqueSet::kCamera, TechniqueSet::kCameraAndLight, TechniqueSet::kCameraGuided,
    TechniqueSet::kCameraAndLightGuided};
// Measured with the best of kPlainChoices, where the scene has use for them.
inline constexpr Technique kAddedChoices[] = {Technique::kSplitting, Technique::kLearnedLights,
                                              Technique::kProduct, Technique::kEmissionGuiding,
                                              Technique::kMerging};
// Measured where the scene has smooth surfaces and lamps that chains may connect.
inline constexpr TechniqueSet kChainsChoice{Technique::kChains};
// Measured where frames may have paths that count in several pixels.
inline constexpr TechniqueSet kSharedChoice{Technique::kSharing},
    kSharedByViewsChoice{Technique::kSharing, Technique::kViews};

// Whether the set is one of kPlainChoices with any of kAddedChoices, kChainsChoice, or a
// shared one.
bool IsTechniqueChoice(TechniqueSet techniques);

// "techniques: auto measures ...": one line that lists the choices.
std::string FormatTechniqueChoices();

}  // namespace sheaf::render
