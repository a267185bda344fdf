// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The trait combinations the renderer is compiled for. A scene runs the cheapest variant that holds
// all of its traits; the generic one holds every trait, so there is always one. The list is kept
// short (at most 64): each entry is compiled once, and functions templated over traits are
// instantiated for each by  #define X(name, traits) template ... F<traits>(...);
// SHEAF_RENDER_VARIANTS(X)
#pragma once

#include <cstdint>

#include "worker/render/traits/trait_set.h"

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
// Coated and rough surfaces that move under area lights.
inline constexpr uint32_t kMovingTraits = kCoatedTraits | TraitSet(Trait::kMotion);
// Coated and rough surfaces in a room under an environment.
inline constexpr uint32_t kOpenTraits =
    TraitSet(Trait::kEnvironment, Trait::kQuadrics, Trait::kMicrofacet, Trait::kLayered);
// Textured things in a studio: area lights and lights without size.
inline constexpr uint32_t kStudioTraits =
    kCoatedTraits | TraitSet(Trait::kTextures, Trait::kDeltaLights);
// What costs scenes without it next to nothing (tests/cost counts it): the kinds of surfaces and
// shapes, of which one is met at a time, and those of lights that have a place.
inline constexpr uint32_t kCommonTraits = TraitSet(
    Trait::kTextures, Trait::kDeltaLights, Trait::kAreaLights, Trait::kSpecularTransmission,
    Trait::kLayered, Trait::kMicrofacet, Trait::kInstances, Trait::kQuadrics);
// What every path would pay for: an environment is looked up in advance, lens and shutter take
// sample points, and light through cut-outs is followed hit by hit. There are variants with every
// combination of these, so that no scene carries one that it does not ask for.
inline constexpr uint32_t kPaidByEveryPath =
    TraitSet(Trait::kEnvironment, Trait::kLens, Trait::kMotion, Trait::kAlpha);
constexpr uint32_t CommonTraits(bool environment, bool lens, bool motion, bool cut_outs) {
  return kCommonTraits | (environment ? TraitSet(Trait::kEnvironment) : 0) |
         (lens ? TraitSet(Trait::kLens) : 0) | (motion ? TraitSet(Trait::kMotion) : 0) |
         (cut_outs ? TraitSet(Trait::kAlpha) : 0);
}

// The same with wavelengths instead of RGB. A scene runs with one of the two, never with what it
// did not call for, so these never serve RGB, nor those spectra.
constexpr uint32_t Spectrally(uint32_t traits) { return traits | TraitSet(Trait::kSpectral); }
// The same with normal and bump maps, for which every vertex has more to remember.
constexpr uint32_t Mapped(uint32_t traits) { return traits | TraitSet(Trait::kNormalMaps); }

// Fog, smoke and glass that absorbs. What bounds a medium often only lets light pass, so all of
// them hold cut-outs.
constexpr uint32_t MediaTraits(bool environment) {
  return CommonTraits(environment, false, false, true) | TraitSet(Trait::kMedia);
}
// The same where media have a colour or shine.
inline constexpr uint32_t kColoredMediaTraits =
    MediaTraits(true) | TraitSet(Trait::kChromaticMedia, Trait::kEmissiveMedia);
// Rooms with glass or liquids that have a colour of their own, and surfaces for boundaries.
inline constexpr uint32_t kColoredGlassTraits =
    CommonTraits(false, false, false, false) | TraitSet(Trait::kMedia, Trait::kChromaticMedia);
// Clouds, smoke and fire on grids, under the sun and a sky, with little else.
inline constexpr uint32_t kCloudTraits = TraitSet(
    Trait::kEnvironment, Trait::kDeltaLights, Trait::kAlpha, Trait::kMicrofacet, Trait::kQuadrics,
    Trait::kMedia, Trait::kHeterogeneousMedia, Trait::kChromaticMedia, Trait::kEmissiveMedia);

}  // namespace sheaf::render

// Of X(name, traits): those of every combination of kPaidByEveryPath but all at once, as wrap
// makes them.
#define SHEAF_COMMON_VARIANTS(X, prefix, wrap)                                                    \
  X(prefix "common", wrap(::sheaf::render::CommonTraits(false, false, false, false)))             \
  X(prefix "common+cut-outs", wrap(::sheaf::render::CommonTraits(false, false, false, true)))     \
  X(prefix "common+motion", wrap(::sheaf::render::CommonTraits(false, false, true, false)))       \
  X(prefix "common+lens", wrap(::sheaf::render::CommonTraits(false, true, false, false)))         \
  X(prefix "common+environment", wrap(::sheaf::render::CommonTraits(true, false, false, false)))  \
  X(prefix "common+motion+cut-outs",                                                              \
    wrap(::sheaf::render::CommonTraits(false, false, true, true)))                                \
  X(prefix "common+lens+cut-outs", wrap(::sheaf::render::CommonTraits(false, true, false, true))) \
  X(prefix "common+lens+motion", wrap(::sheaf::render::CommonTraits(false, true, true, false)))   \
  X(prefix "common+environment+cut-outs",                                                         \
    wrap(::sheaf::render::CommonTraits(true, false, false, true)))                                \
  X(prefix "common+environment+motion",                                                           \
    wrap(::sheaf::render::CommonTraits(true, false, true, false)))                                \
  X(prefix "common+environment+lens",                                                             \
    wrap(::sheaf::render::CommonTraits(true, true, false, false)))                                \
  X(prefix "common+lens+motion+cut-outs",                                                         \
    wrap(::sheaf::render::CommonTraits(false, true, true, true)))                                 \
  X(prefix "common+environment+motion+cut-outs",                                                  \
    wrap(::sheaf::render::CommonTraits(true, false, true, true)))                                 \
  X(prefix "common+environment+lens+cut-outs",                                                    \
    wrap(::sheaf::render::CommonTraits(true, true, false, true)))                                 \
  X(prefix "common+environment+lens+motion",                                                      \
    wrap(::sheaf::render::CommonTraits(true, true, true, false)))

#define SHEAF_MEDIA_VARIANTS(X, prefix, wrap)                             \
  X(prefix "media", wrap(::sheaf::render::MediaTraits(false)))            \
  X(prefix "media+environment", wrap(::sheaf::render::MediaTraits(true))) \
  X(prefix "colored media", wrap(::sheaf::render::kColoredMediaTraits))

// X(name, traits), the generic ones last: they serve what is too rare for variants of its own.
#define SHEAF_RENDER_VARIANTS(X)                                                      \
  X("diffuse", ::sheaf::render::kDiffuseTraits)                                       \
  X("glossy", ::sheaf::render::kGlossyTraits)                                         \
  X("coated", ::sheaf::render::kCoatedTraits)                                         \
  X("outdoor", ::sheaf::render::kOutdoorTraits)                                       \
  X("open", ::sheaf::render::kOpenTraits)                                             \
  X("moving", ::sheaf::render::kMovingTraits)                                         \
  X("studio", ::sheaf::render::kStudioTraits)                                         \
  X("cloud", ::sheaf::render::kCloudTraits)                                           \
  X("colored glass", ::sheaf::render::kColoredGlassTraits)                            \
  SHEAF_COMMON_VARIANTS(X, "", )                                                      \
  SHEAF_COMMON_VARIANTS(X, "mapped ", ::sheaf::render::Mapped)                        \
  SHEAF_MEDIA_VARIANTS(X, "", )                                                       \
  SHEAF_MEDIA_VARIANTS(X, "spectral ", ::sheaf::render::Spectrally)                   \
  X("spectral glossy", ::sheaf::render::Spectrally(::sheaf::render::kGlossyTraits))   \
  X("spectral outdoor", ::sheaf::render::Spectrally(::sheaf::render::kOutdoorTraits)) \
  SHEAF_COMMON_VARIANTS(X, "spectral ", ::sheaf::render::Spectrally)                  \
  X("spectral generic", ::sheaf::render::kAllSpectralTraits)                          \
  X("generic", ::sheaf::render::kAllTraits)
