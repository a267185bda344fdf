// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TraitSet: sets of traits as bits, the template parameter of code that is compiled for the needs
// of a scene.
#pragma once

#include <cstdint>

namespace sheaf::render {

// One bit each. A variant that is compiled with fewer traits runs no code for the others.
enum class Trait : uint32_t {
  kMotion = 1u << 0,                // Animated transforms within an open shutter.
  kLens = 1u << 1,                  // Lens radius > 0, or a realistic lens.
  kTextures = 1u << 2,              // Image or procedural textures.
  kEnvironment = 1u << 3,           // Infinite lights.
  kDeltaLights = 1u << 4,           // Lights without size.
  kAreaLights = 1u << 5,            // Emissive shapes.
  kSpecularTransmission = 1u << 6,  // Dielectrics, diffuse transmission.
  kLayered = 1u << 7,               // Coated materials.
  kMicrofacet = 1u << 8,            // Rough or smooth conductors, rough coats.
  kAlpha = 1u << 9,                 // Cut-outs, interfaces, stochastic mixes.
  kInstances = 1u << 10,            // Object instances.
  kQuadrics = 1u << 11,             // Shapes intersected in double: quadrics, bilinear patches.
  kSpectral = 1u << 12,             // Four wavelengths per path instead of RGB.
  kHair = 1u << 13,                 // Fibers: light passes through them whatever their normals.
  kMeasured = 1u << 14,             // Measured reflection from files.
  kCurves = 1u << 15,               // Curves with a width.
  kNormalMaps = 1u << 16,           // Normal and bump maps.
  kTexturedEmission = 1u << 17,     // Emissive shapes with an image or a cut-out.
  kOutputs = 1u << 18,              // Outputs besides the image: FilmOutputs.
  kMedia = 1u << 19,                // Participating media.
  kHeterogeneousMedia = 1u << 20,   // Heterogeneous media.
  kChromaticMedia = 1u << 21,       // Media that absorb or scatter color components differently.
  kEmissiveMedia = 1u << 22,        // Media that emit.
  kDeformation = 1u << 23,          // Meshes whose vertices move within an open shutter.
  kSubsurface = 1u << 24,           // Subsurface scattering.
  kNestedDielectrics = 1u << 25,    // Overlapping interiors, by priority.
  kMovingVolumes = 1u << 26,        // Media moved by velocities within an open shutter.
  kGuiding = 1u << 27,              // Directions sampled from a learned field.
  kLightSplits = 1u << 28,          // Several light samples at a vertex.
  kPrincipled = 1u << 29,           // Principled materials.
  kVertexNormals = 1u << 30,        // Vertex normals tilted from the faces of their meshes.
  kLearnedLights = 1u << 31,        // Lights chosen by learned rows without guiding, or by product.
};
inline constexpr int kTraitCount = 32;

constexpr bool Has(uint32_t traits, Trait trait) {
  return (traits & static_cast<uint32_t>(trait)) != 0;
}
constexpr uint32_t TraitSet() { return 0; }
template <typename... Rest>
constexpr uint32_t TraitSet(Trait first, Rest... rest) {
  return static_cast<uint32_t>(first) | TraitSet(rest...);
}

// Whether the choice of lights goes by what regions of space have learned.
constexpr bool KnowsLights(uint32_t traits) {
  return (traits & TraitSet(Trait::kGuiding, Trait::kLearnedLights)) != 0;
}

// Traits for which a path tracks its media and interiors.
inline constexpr uint32_t kInsides =
    TraitSet(Trait::kMedia, Trait::kSubsurface, Trait::kNestedDielectrics);

// Every trait that a scene may need, with color as RGB and as spectra.
inline constexpr uint32_t kAllSpectralTraits = ~0u;
inline constexpr uint32_t kAllTraits = kAllSpectralTraits & ~TraitSet(Trait::kSpectral);

}  // namespace sheaf::render
