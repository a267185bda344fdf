// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Variants of the list with one trait compiled out that they carry for the sake of other scenes.
// Nothing renders with them: tests/cost counts what carrying the trait costs a scene without it.
// Traits that are not here are in no variant that a scene without them runs.
#pragma once

#include <cstdint>

#include "worker/render/variant_list.h"

namespace sheaf::render {

inline constexpr uint32_t kSpectralAnimatedWithoutMotion =
    kSpectralAnimatedTraits & ~TraitSet(Trait::kMotion);
inline constexpr uint32_t kPlacedWithoutLens = kPlacedTraits & ~TraitSet(Trait::kLens);
inline constexpr uint32_t kStillWithoutTextures = kStillTraits & ~TraitSet(Trait::kTextures);
inline constexpr uint32_t kStillWithoutEnvironment = kStillTraits & ~TraitSet(Trait::kEnvironment);
inline constexpr uint32_t kStillWithoutDeltaLights = kStillTraits & ~TraitSet(Trait::kDeltaLights);
inline constexpr uint32_t kStillWithoutAreaLights = kStillTraits & ~TraitSet(Trait::kAreaLights);
inline constexpr uint32_t kGlossyWithoutTransmission =
    kGlossyTraits & ~TraitSet(Trait::kSpecularTransmission);
inline constexpr uint32_t kStillWithoutLayers = kStillTraits & ~TraitSet(Trait::kLayered);
inline constexpr uint32_t kGlossyWithoutMicrofacets = kGlossyTraits & ~TraitSet(Trait::kMicrofacet);
inline constexpr uint32_t kStaticWithoutInstances = kStaticTraits & ~TraitSet(Trait::kInstances);
inline constexpr uint32_t kGlossyWithoutQuadrics = kGlossyTraits & ~TraitSet(Trait::kQuadrics);

}  // namespace sheaf::render

// X(name of the trait in the plan, traits of the variant without it).
#define SHEAF_ABLATED_VARIANTS(X)                                \
  X("motion", ::sheaf::render::kSpectralAnimatedWithoutMotion)   \
  X("lens", ::sheaf::render::kPlacedWithoutLens)                 \
  X("textures", ::sheaf::render::kStillWithoutTextures)          \
  X("environment", ::sheaf::render::kStillWithoutEnvironment)    \
  X("delta lights", ::sheaf::render::kStillWithoutDeltaLights)   \
  X("area lights", ::sheaf::render::kStillWithoutAreaLights)     \
  X("transmission", ::sheaf::render::kGlossyWithoutTransmission) \
  X("layered materials", ::sheaf::render::kStillWithoutLayers)   \
  X("microfacets", ::sheaf::render::kGlossyWithoutMicrofacets)   \
  X("instances", ::sheaf::render::kStaticWithoutInstances)       \
  X("curved shapes", ::sheaf::render::kGlossyWithoutQuadrics)
