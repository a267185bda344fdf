// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The traits by the names that users see, with what each typically costs.
#pragma once

#include <iterator>

#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

struct TraitName {
  Trait trait;
  const char* name;
  double time_ratio = 0;  // PlannedEffect::expected_time_ratio, from tests/bench/effect_cost.py.
};
inline constexpr TraitName kTraitNames[] = {
    {Trait::kMotion, "motion", 1.38},
    {Trait::kDeformation, "deformation", 1.62},
    {Trait::kLens, "lens", 1.05},
    {Trait::kTextures, "textures", 1.03},
    {Trait::kNormalMaps, "normal and bump maps", 1.38},
    {Trait::kTexturedEmission, "textured emission", 1.13},
    {Trait::kEnvironment, "environment", 1.19},
    {Trait::kDeltaLights, "delta lights", 1.02},
    {Trait::kAreaLights, "area lights", 2.35},
    {Trait::kSpecularTransmission, "transmission", 1.05},
    {Trait::kLayered, "layered materials", 1.04},
    {Trait::kMicrofacet, "microfacets", 1.06},
    {Trait::kAlpha, "alpha and mixes", 1.18},
    {Trait::kInstances, "instances", 1.58},
    {Trait::kQuadrics, "quadrics", 1.03},
    {Trait::kSpectral, "spectral transport", 1.18},
    {Trait::kHair, "hair", 1.26},
    {Trait::kMeasured, "measured materials"},
    {Trait::kCurves, "curves", 1.34},
    {Trait::kOutputs, "outputs", 1.34},
    {Trait::kMedia, "media", 4.75},
    {Trait::kHeterogeneousMedia, "heterogeneous media", 0.81},
    {Trait::kMovingVolumes, "moving volumes", 1.05},
    {Trait::kChromaticMedia, "chromatic media", 1.22},
    {Trait::kEmissiveMedia, "emissive media", 1.07},
    {Trait::kSubsurface, "subsurface", 3.9},
    {Trait::kNestedDielectrics, "nested dielectrics", 1.26},
    {Trait::kGuiding, "guiding"},
    {Trait::kLightSplits, "light splits"},
    {Trait::kPrincipled, "principled materials"},
    {Trait::kVertexNormals, "vertex normals", 1.07},
    {Trait::kLearnedLights, "learned lights"},
    {Trait::kRayVisibility, "ray visibility", 1.36},
};
static_assert(std::size(kTraitNames) == kTraitCount);

}  // namespace sheaf::render
