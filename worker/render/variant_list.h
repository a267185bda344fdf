// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The trait combinations the renderer is compiled for. A scene runs the variant with the fewest
// traits that holds all of its own; the generic one holds every trait, so there is always one. The
// list is kept short: each entry is compiled once, and functions templated over traits are
// instantiated for each by  #define X(name, traits) template ... F<traits>(...);
// SHEAF_RENDER_VARIANTS(X)
#pragma once

#include <cstdint>

#include "worker/render/render_plan.h"
#include "worker/render/trait_set.h"

namespace sheaf::render {

// Plain rooms: diffuse surfaces and area lights.
inline constexpr uint32_t kDiffuseTraits = TraitSet(Trait::kAreaLights);
// Glass and metal under area lights.
inline constexpr uint32_t kGlossyTraits = TraitSet(
    Trait::kAreaLights, Trait::kQuadrics, Trait::kMicrofacet, Trait::kSpecularTransmission);
// Coated and rough surfaces under area lights.
inline constexpr uint32_t kCoatedTraits =
    TraitSet(Trait::kAreaLights, Trait::kQuadrics, Trait::kMicrofacet, Trait::kLayered);
// Products under an environment map.
inline constexpr uint32_t kOutdoorTraits =
    TraitSet(Trait::kEnvironment, Trait::kTextures, Trait::kMicrofacet, Trait::kLayered);
// Everything that stands still, is opaque or glass, and is placed once; seen through a pinhole.
inline constexpr uint32_t kStillTraits =
    TraitSet(Trait::kTextures, Trait::kEnvironment, Trait::kDeltaLights, Trait::kAreaLights,
             Trait::kSpecularTransmission, Trait::kLayered, Trait::kMicrofacet, Trait::kQuadrics);
inline constexpr uint32_t kStillLensTraits = kStillTraits | TraitSet(Trait::kLens);
// All but motion.
inline constexpr uint32_t kStaticTraits =
    kStillLensTraits | TraitSet(Trait::kAlpha, Trait::kInstances);

// And with maps on it: normal and bump maps, emission that varies.
inline constexpr uint32_t kMappedTraits =
    kStaticTraits | TraitSet(Trait::kNormalMaps, Trait::kVaryingEmission);

// The same with wavelengths instead of RGB. A scene runs with one of the two, never with what it
// did not call for, so these never serve RGB, nor those spectra.
inline constexpr uint32_t kSpectralBit = TraitSet(Trait::kSpectral);
inline constexpr uint32_t kSpectralGlossyTraits = kGlossyTraits | kSpectralBit;
inline constexpr uint32_t kSpectralOutdoorTraits = kOutdoorTraits | kSpectralBit;
inline constexpr uint32_t kSpectralStillTraits = kStillTraits | kSpectralBit;

}  // namespace sheaf::render

// X(name, traits), fewest traits first, the generic one last.
#define SHEAF_RENDER_VARIANTS(X)                                 \
  X("diffuse", ::sheaf::render::kDiffuseTraits)                  \
  X("glossy", ::sheaf::render::kGlossyTraits)                    \
  X("coated", ::sheaf::render::kCoatedTraits)                    \
  X("outdoor", ::sheaf::render::kOutdoorTraits)                  \
  X("still", ::sheaf::render::kStillTraits)                      \
  X("still-lens", ::sheaf::render::kStillLensTraits)             \
  X("static", ::sheaf::render::kStaticTraits)                    \
  X("mapped", ::sheaf::render::kMappedTraits)                    \
  X("spectral glossy", ::sheaf::render::kSpectralGlossyTraits)   \
  X("spectral outdoor", ::sheaf::render::kSpectralOutdoorTraits) \
  X("spectral still", ::sheaf::render::kSpectralStillTraits)     \
  X("spectral generic", ::sheaf::render::kAllSpectralTraits)     \
  X("generic", ::sheaf::render::kAllTraits)
