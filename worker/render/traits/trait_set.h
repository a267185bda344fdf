// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TraitSet: sets of traits as bits, the template parameter of code that is compiled for the needs
// of a scene.
#pragma once

#include <cstdint>

namespace sheaf::render {

// A set of traits.
using TraitBits = uint64_t;

// One bit each. A variant that is compiled with fewer traits runs no code for the others.
enum class Trait : TraitBits {
  kMotion = 1ull << 0,                // Animated transforms within an open shutter.
  kLens = 1ull << 1,                  // Lens radius > 0, or a realistic lens.
  kTextures = 1ull << 2,              // Image or procedural textures.
  kEnvironment = 1ull << 3,           // Infinite lights.
  kDeltaLights = 1ull << 4,           // Lights without size.
  kAreaLights = 1ull << 5,            // Emissive shapes.
  kSpecularTransmission = 1ull << 6,  // Dielectrics, diffuse transmission.
  kLayered = 1ull << 7,               // Coated materials.
  kMicrofacet = 1ull << 8,            // Rough or smooth conductors, rough coats.
  kAlpha = 1ull << 9,                 // Cut-outs, interfaces, stochastic mixes.
  kInstances = 1ull << 10,            // Object instances.
  kQuadrics = 1ull << 11,             // Shapes intersected in double: quadrics, bilinear patches.
  kSpectral = 1ull << 12,             // Four wavelengths per path instead of RGB.
  kHair = 1ull << 13,                 // Fibers: light passes through them whatever their normals.
  kMeasured = 1ull << 14,             // Measured reflection from files.
  kCurves = 1ull << 15,               // Curves with a width.
  kNormalMaps = 1ull << 16,           // Normal and bump maps.
  kTexturedEmission = 1ull << 17,     // Emissive shapes with an image or a cut-out.
  kOutputs = 1ull << 18,              // Outputs besides the image: FilmOutputs.
  kMedia = 1ull << 19,                // Participating media.
  kHeterogeneousMedia = 1ull << 20,   // Heterogeneous media.
  kChromaticMedia = 1ull << 21,       // Media that absorb or scatter color components differently.
  kEmissiveMedia = 1ull << 22,        // Media that emit.
  kDeformation = 1ull << 23,          // Meshes whose vertices move within an open shutter.
  kSubsurface = 1ull << 24,           // Subsurface scattering.
  kNestedDielectrics = 1ull << 25,    // Overlapping interiors, by priority.
  kMovingVolumes = 1ull << 26,        // Media moved by velocities within an open shutter.
  kGuiding = 1ull << 27,              // Directions sampled from a learned field.
  kLightSplits = 1ull << 28,          // Several light samples at a vertex.
  kPrincipled = 1ull << 29,           // Principled materials.
  kVertexNormals = 1ull << 30,        // Vertex normals tilted from the faces of their meshes.
  kLearnedLights = 1ull << 31,  // Lights chosen by learned rows without guiding, or by product.
  kRayVisibility = 1ull << 32,  // Shapes and lights that rays of some kinds do not see.
};
inline constexpr int kTraitCount = 33;

constexpr bool Has(TraitBits traits, Trait trait) {
  return (traits & static_cast<TraitBits>(trait)) != 0;
}
constexpr TraitBits TraitSet() { return 0; }
template <typename... Rest>
constexpr TraitBits TraitSet(Trait first, Rest... rest) {
  return static_cast<TraitBits>(first) | TraitSet(rest...);
}

// Whether the choice of lights goes by what regions of space have learned.
constexpr bool KnowsLights(TraitBits traits) {
  return (traits & TraitSet(Trait::kGuiding, Trait::kLearnedLights)) != 0;
}

// Traits for which a path tracks its media and interiors.
inline constexpr TraitBits kInsides =
    TraitSet(Trait::kMedia, Trait::kSubsurface, Trait::kNestedDielectrics);

// Every trait that a scene may need, with color as RGB and as spectra.
inline constexpr TraitBits kAllSpectralTraits = (TraitBits{1} << kTraitCount) - 1;
inline constexpr TraitBits kAllTraits = kAllSpectralTraits & ~TraitSet(Trait::kSpectral);

}  // namespace sheaf::render
