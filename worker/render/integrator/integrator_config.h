// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// IntegratorConfig: the compile-time parameters of the path integrator. Every component is a
// template over one configuration C and reads its constants and types from it, so that code for
// effects that a scene does not use is not compiled into the variant that renders it.
#pragma once

#include <cstdint>
#include <type_traits>

#include "worker/render/color/wavelengths.h"
#include "worker/render/integrator/direct_light.h"
#include "worker/render/sampling/mutated_sampler.h"
#include "worker/render/sampling/sampler.h"
#include "worker/render/traits/trait_set.h"

namespace sheaf::render {

// Where the integrator's paths begin.
enum class PathKind : uint8_t {
  kCamera,             // At the camera; they alone make the image.
  kCameraBesideLight,  // At the camera; light paths find part of the light.
  kLight,              // At a light.
  kEye,                // At one of two eyes, which share their paths: worker/render/eyes.
  kMutated,            // At the camera, by numbers that a chain moves: worker/render/mutations.
  kCameraWithChains,   // At the camera; chains find part of the light: chains.h.
};

// TracerT: EmbreeScene, or a class with the same Intersect and Occluded.
template <TraitBits kTraitsT, typename TracerT, DirectLight kDirectLightT,
          PathKind kPathKindT = PathKind::kCamera>
struct IntegratorConfig {
  using Tracer = TracerT;
  static constexpr TraitBits kTraits = kTraitsT;
  static constexpr DirectLight kDirectLight = kDirectLightT;
  static constexpr PathKind kPathKind = kPathKindT;
  // Paths begin at lights, and are connected to the camera.
  static constexpr bool kFromLight = kPathKind == PathKind::kLight;
  // Paths of both kinds find the light of the frame, and weigh each other: two_ends.h.
  static constexpr bool kBothEnds = kFromLight || kPathKind == PathKind::kCameraBesideLight;
  // Paths of two eyes share what they find from their first vertex on.
  static constexpr bool kEyes = kPathKind == PathKind::kEye;
  // The same sample is traced with mutated numbers.
  static constexpr bool kMutated = kPathKind == PathKind::kMutated;
  using Sampler = std::conditional_t<kMutated, MutatedSampler, render::Sampler>;
  // Frames whose paths are of these kinds have no learned fields.
  static constexpr bool kUsesFields = !kEyes && !kMutated;
  // Vertices are connected to lamps through smooth interfaces: chains.h.
  static constexpr bool kChains = kPathKind == PathKind::kCameraWithChains;
  // Vertices are seen from other directions than the path's: SurfaceVertex::SeenFrom.
  static constexpr bool kSeenFromElsewhere = kBothEnds || kEyes;
  // Vertices know the normal that their surface gives, whatever the path that arrives.
  static constexpr bool kKeepsNormal = kSeenFromElsewhere || kChains;
  using Color = ColorOf<kTraits>;
  using Wavelengths = WavelengthsOf<Color>;
  // For queries that need no color, or the color as RGB.
  static constexpr TraitBits kRgbTraits = kTraits & ~TraitSet(Trait::kSpectral);

  static constexpr bool Has(Trait trait) { return render::Has(kTraits, trait); }
  static constexpr bool kSpectral = Has(Trait::kSpectral);
  static constexpr bool kOutputs = Has(Trait::kOutputs);
  // Camera paths sample directions from a learned field too: guided_directions.h.
  static constexpr bool kGuided = kUsesFields && Has(Trait::kGuiding);
  // Lights are chosen by what the region of a vertex has learned.
  static constexpr bool kKnowsLights = kUsesFields && KnowsLights(kTraits);
  // Lights may be chosen by a sketch of what the vertex reflects: LobeSketch. Not beside light
  // paths, which would have to know the sketches of the camera's vertices before these are found.
  static constexpr bool kProduct = kPathKind == PathKind::kCamera && Has(Trait::kLearnedLights);
  // Vertices of camera paths on surfaces may take several light samples: light_splits.h. Light
  // paths count them in weights.
  static constexpr bool kSplitsLights = !kFromLight && kUsesFields && Has(Trait::kLightSplits);
  static constexpr bool kCountsSplits = kFromLight && Has(Trait::kLightSplits);
  // Rays are of kinds that do not see everything: ray_sight.h. Paths from lights do not know
  // their kinds, and those that pixels or eyes share have several.
  static constexpr bool kRayKinds = kPathKind == PathKind::kCamera && Has(Trait::kRayVisibility);
  static constexpr bool kNormalMaps = Has(Trait::kNormalMaps);
  // Shading normals may be tilted so far that light would be lost: perturbed_normal.h.
  static constexpr bool kPerturbedNormals = kNormalMaps || Has(Trait::kVertexNormals);
  // Rays may pass through surfaces: cut-outs, interface materials, stochastic mixes.
  static constexpr bool kNullInterfaces = Has(Trait::kAlpha);
  // Paths track the media and interiors that they are in.
  static constexpr bool kMedia = (kTraits & kInsides) != 0;
  static constexpr bool kNested = Has(Trait::kNestedDielectrics);
  static constexpr bool kSubsurface = Has(Trait::kSubsurface);
  static constexpr bool kTexturedSubsurface = kSubsurface && Has(Trait::kTextures);
  static constexpr bool kChromaticMedia = Has(Trait::kChromaticMedia);
  static constexpr bool kHeterogeneous = kMedia && Has(Trait::kHeterogeneousMedia);
  // Segments of camera paths in media sample lights along the segment: equiangular_sampling.h.
  // Light paths count them in weights.
  static constexpr bool kHasLines =
      Has(Trait::kMedia) && (Has(Trait::kAreaLights) || Has(Trait::kDeltaLights));
  static constexpr bool kLines = !kFromLight && kHasLines;
  static constexpr bool kCountsLines = kFromLight && kHasLines;
  static constexpr bool kHeterogeneousLines = kHasLines && kHeterogeneous;
  // Vertices sample directions by the emission of media: volume_emission.h.
  static constexpr bool kSamplesEmission =
      !kFromLight && kHeterogeneous && Has(Trait::kEmissiveMedia);
};

}  // namespace sheaf::render
