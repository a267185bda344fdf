// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The trait combinations for which the renderer is compiled. A scene uses the cheapest variant that
// contains all of its traits; the generic one contains every trait, so there is always one. The
// list is kept short (at most 64): each entry is compiled once, and functions templated over traits
// are instantiated for each by  #define X(name, traits) template ... F<traits>(...);
// SHEAF_RENDER_VARIANTS(X)
#pragma once

#include <cstdint>

#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

// Simple rooms: diffuse surfaces and area lights.
inline constexpr TraitBits kDiffuseTraits = TraitSet(Trait::kAreaLights);
// Glass and metal under area lights.
inline constexpr TraitBits kGlossyTraits = TraitSet(
    Trait::kAreaLights, Trait::kQuadrics, Trait::kMicrofacet, Trait::kSpecularTransmission);
// Coated and rough surfaces under area lights.
inline constexpr TraitBits kCoatedTraits =
    TraitSet(Trait::kAreaLights, Trait::kQuadrics, Trait::kMicrofacet, Trait::kLayered,
             Trait::kVertexNormals);
// Products under an environment map.
inline constexpr TraitBits kOutdoorTraits =
    TraitSet(Trait::kEnvironment, Trait::kTextures, Trait::kMicrofacet, Trait::kLayered,
             Trait::kVertexNormals);
// Moving coated and rough surfaces under area lights.
inline constexpr TraitBits kMovingTraits = kCoatedTraits | TraitSet(Trait::kMotion);
// Coated and rough surfaces in a room under an environment.
inline constexpr TraitBits kOpenTraits =
    TraitSet(Trait::kEnvironment, Trait::kQuadrics, Trait::kMicrofacet, Trait::kLayered,
             Trait::kVertexNormals);
// Textured objects in a studio: area lights and lights without size.
inline constexpr TraitBits kStudioTraits =
    kCoatedTraits | TraitSet(Trait::kTextures, Trait::kDeltaLights);
// Traits that cost almost nothing in scenes without them (tests/cost counts it): the kinds of
// surfaces and shapes, of which a hit involves one, and those of lights with a position.
inline constexpr TraitBits kCommonTraits =
    TraitSet(Trait::kTextures, Trait::kDeltaLights, Trait::kAreaLights,
             Trait::kSpecularTransmission, Trait::kLayered, Trait::kMicrofacet, Trait::kInstances,
             Trait::kQuadrics, Trait::kVertexNormals);
// Traits that every path would pay for: environment lookups are prefetched, lens and shutter use
// sample points, and shadow rays test cut-outs hit by hit. There are variants with every
// combination of these, so that no scene includes one that it does not need.
inline constexpr TraitBits kPaidByEveryPath =
    TraitSet(Trait::kEnvironment, Trait::kLens, Trait::kMotion, Trait::kAlpha);
constexpr TraitBits CommonTraits(bool environment, bool lens, bool motion, bool cut_outs) {
  return kCommonTraits | (environment ? TraitSet(Trait::kEnvironment) : 0) |
         (lens ? TraitSet(Trait::kLens) : 0) | (motion ? TraitSet(Trait::kMotion) : 0) |
         (cut_outs ? TraitSet(Trait::kAlpha) : 0);
}

// The same with wavelengths instead of RGB. A scene uses exactly one of the two, so these variants
// never serve RGB scenes, nor the others spectral ones.
constexpr TraitBits Spectrally(TraitBits traits) { return traits | TraitSet(Trait::kSpectral); }
// The same with normal and bump maps, which add state to every vertex.
constexpr TraitBits Mapped(TraitBits traits) { return traits | TraitSet(Trait::kNormalMaps); }

// The same with directions from a learned field.
constexpr TraitBits Guided(TraitBits traits) { return traits | TraitSet(Trait::kGuiding); }
// The same with lights that are chosen by what regions have learned.
constexpr TraitBits LearnedLights(TraitBits traits) {
  return traits | TraitSet(Trait::kLearnedLights);
}
// The same with several light samples at a vertex.
constexpr TraitBits LightSplit(TraitBits traits) { return traits | TraitSet(Trait::kLightSplits); }

// Principled materials, such as those of glTF files, with what such scenes have besides.
inline constexpr TraitBits kPrincipledTraits =
    Mapped(CommonTraits(true, false, false, true)) | TraitSet(Trait::kPrincipled);

// Fog, smoke and absorbing glass. Medium boundaries are often null interfaces, so all of these
// include cut-outs.
constexpr TraitBits MediaTraits(bool environment) {
  return CommonTraits(environment, false, false, true) | TraitSet(Trait::kMedia);
}
// The same with chromatic or emissive media.
inline constexpr TraitBits kColoredMediaTraits =
    MediaTraits(true) | TraitSet(Trait::kChromaticMedia, Trait::kEmissiveMedia);
// Rooms with colored glass or liquids, bounded by surfaces.
inline constexpr TraitBits kColoredGlassTraits =
    CommonTraits(false, false, false, false) | TraitSet(Trait::kMedia, Trait::kChromaticMedia);
// Clouds, smoke and fire on grids, under the sun and a sky, with few other effects.
inline constexpr TraitBits kCloudTraits =
    TraitSet(Trait::kEnvironment, Trait::kDeltaLights, Trait::kAlpha, Trait::kMicrofacet,
             Trait::kQuadrics, Trait::kMedia, Trait::kHeterogeneousMedia, Trait::kChromaticMedia,
             Trait::kEmissiveMedia, Trait::kVertexNormals);

}  // namespace sheaf::render

// X(name, traits) for every combination of kPaidByEveryPath except all four, with traits passed
// through wrap.
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

#define SHEAF_GUIDED_VARIANTS(X)                                                        \
  X("guided common",                                                                    \
    ::sheaf::render::Guided(::sheaf::render::CommonTraits(false, false, false, false))) \
  X("guided common+environment+cut-outs",                                               \
    ::sheaf::render::Guided(::sheaf::render::CommonTraits(true, false, false, true)))

#define SHEAF_LEARNED_LIGHTS_VARIANTS(X)                                                       \
  X("learned lights common",                                                                   \
    ::sheaf::render::LearnedLights(::sheaf::render::CommonTraits(false, false, false, false))) \
  X("learned lights common+environment+cut-outs",                                              \
    ::sheaf::render::LearnedLights(::sheaf::render::CommonTraits(true, false, false, true)))

#define SHEAF_LIGHT_SPLIT_VARIANTS(X)                                                       \
  X("light splits common",                                                                  \
    ::sheaf::render::LightSplit(::sheaf::render::CommonTraits(false, false, false, false))) \
  X("light splits common+environment+cut-outs",                                             \
    ::sheaf::render::LightSplit(::sheaf::render::CommonTraits(true, false, false, true)))

// X(name, traits): the variants that render every scene.
#define SHEAF_GENERIC_VARIANTS(X)                            \
  X("spectral generic", ::sheaf::render::kAllSpectralTraits) \
  X("generic", ::sheaf::render::kAllTraits)

#ifdef SHEAF_GENERIC_VARIANTS_ONLY
// SHEAF_VARIANTS=generic. Compilers take long for each variant, those of sanitizers minutes.
#define SHEAF_RENDER_VARIANTS(X) SHEAF_GENERIC_VARIANTS(X)
#define SHEAF_LIGHT_PATH_VARIANTS(X) SHEAF_GENERIC_VARIANTS(X)
#define SHEAF_CHAIN_VARIANTS(X) SHEAF_GENERIC_VARIANTS(X)
#define SHEAF_MUTATION_VARIANTS(X) SHEAF_GENERIC_VARIANTS(X)
#define SHEAF_EYE_VARIANTS(X) SHEAF_GENERIC_VARIANTS(X)
#else

// X(name, traits), the generic ones last: they serve combinations too rare for their own variants.
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
  X("principled", ::sheaf::render::kPrincipledTraits)                                 \
  SHEAF_COMMON_VARIANTS(X, "", )                                                      \
  SHEAF_COMMON_VARIANTS(X, "mapped ", ::sheaf::render::Mapped)                        \
  SHEAF_MEDIA_VARIANTS(X, "", )                                                       \
  SHEAF_MEDIA_VARIANTS(X, "spectral ", ::sheaf::render::Spectrally)                   \
  X("spectral glossy", ::sheaf::render::Spectrally(::sheaf::render::kGlossyTraits))   \
  X("spectral outdoor", ::sheaf::render::Spectrally(::sheaf::render::kOutdoorTraits)) \
  SHEAF_COMMON_VARIANTS(X, "spectral ", ::sheaf::render::Spectrally)                  \
  SHEAF_GUIDED_VARIANTS(X)                                                            \
  SHEAF_LEARNED_LIGHTS_VARIANTS(X)                                                    \
  SHEAF_LIGHT_SPLIT_VARIANTS(X)                                                       \
  SHEAF_GENERIC_VARIANTS(X)

// The variants of frames with light paths. Few: a path of either kind costs more than its traits.
#define SHEAF_LIGHT_PATH_VARIANTS(X)                                                           \
  X("common", ::sheaf::render::CommonTraits(false, false, false, false))                       \
  X("guided common",                                                                           \
    ::sheaf::render::Guided(::sheaf::render::CommonTraits(false, false, false, false)))        \
  X("learned lights common",                                                                   \
    ::sheaf::render::LearnedLights(::sheaf::render::CommonTraits(false, false, false, false))) \
  SHEAF_GENERIC_VARIANTS(X)

// The variants of frames whose bright samples start chains of mutations. Few: such frames are rare.
#define SHEAF_MUTATION_VARIANTS(X)                                       \
  X("common", ::sheaf::render::CommonTraits(false, false, false, false)) \
  SHEAF_GENERIC_VARIANTS(X)

// The variants of frames with chains. Few, for the same reason.
#define SHEAF_CHAIN_VARIANTS(X)                                          \
  X("glossy", ::sheaf::render::kGlossyTraits)                            \
  X("common", ::sheaf::render::CommonTraits(false, false, false, false)) \
  SHEAF_GENERIC_VARIANTS(X)

// The variants of frames whose paths count in several pixels, such as stereo frames.
#define SHEAF_EYE_VARIANTS(X)                                                                   \
  X("common", ::sheaf::render::CommonTraits(false, false, false, false))                        \
  X("common+environment", ::sheaf::render::CommonTraits(true, false, false, false))             \
  X("common+environment+lens+cut-outs", ::sheaf::render::CommonTraits(true, true, false, true)) \
  X("common+environment+lens+motion", ::sheaf::render::CommonTraits(true, true, true, false))   \
  X("mapped common+environment+cut-outs",                                                       \
    ::sheaf::render::Mapped(::sheaf::render::CommonTraits(true, false, false, true)))           \
  SHEAF_GENERIC_VARIANTS(X)
#endif
