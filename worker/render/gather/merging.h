// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Merging of light paths with camera paths: radius, limits, and the numbers that all paths of a
// light pass share.
//
// A light path that arrives within the radius of a camera path's vertex is taken to arrive at that
// vertex. So light is found that the camera sees through smooth glass or in mirrors, at the price
// of a blur. The radius is a number of pixel footprints, and shrinks with the passes of a replicate
// so that bias and noise both vanish. All replicates have the same radii, so that error bars are
// true for the noise. Weights depend on the first radius alone: then they are the same in every
// pass, and the two kinds of path may have different numbers of samples. Source: Georgiev,
// Krivanek, Davidovic and Slusallek 2012, "Light Transport Simulation with Vertex Connection and
// Merging"; Knaus and Zwicker 2011, "Progressive Photon Mapping: A Probabilistic Approach";
// docs/adr/0130.
#pragma once

#include <cstddef>
#include <cstdint>

#include "common/film/tile_geometry.h"

namespace sheaf::render {

// The first radius, in footprints of a pixel at the vertex.
inline constexpr double kMergeFootprints = 2;
// The last of n passes has n^((kMergeAlpha - 1) / 2) times the first radius.
inline constexpr double kMergeAlpha = 2.0 / 3;
// Surfaces with a smaller GGX width are left to camera paths: their blur would be seen.
inline constexpr float kMergeAlphaMin = 0.1f;
// The normals of the two surfaces must have at least this cosine.
inline constexpr float kMergeNormalCosineMin = 0.4f;
// Light paths that arrive at a smaller cosine are not merged, but counted: their weight is without
// bound.
inline constexpr float kGrazingCosineMin = 1e-4f;
// Camera paths that one pass stores. In larger frames, a pass takes one in GatherStep pixels.
inline constexpr uint64_t kGatherPointsMax = 2'000'000;

// A pass stores the camera path of one in this number of pixels.
uint32_t GatherStep(int64_t pixel_count);
// The most camera paths that a pass stores of a window.
uint64_t GatherPointsMax(const PixelRect& window, uint32_t step);
// Whether the pixel is one of them. Over `step` passes of a replicate each pixel is, once.
bool GathersAt(uint64_t seed, int64_t pixel, uint64_t pass, uint32_t step);

// The radius of weights where camera rays have this density, per area that faces them. The result
// scales exactly with powers of two.
float MergeRadius(double ray_density);
// The radius of merging in the pass over that of weights.
float MergeRadiusScale(uint64_t pass);

// The sample that all paths of a pass share: only paths of one time and one set of wavelengths
// meet.
struct PassSample {
  float time = 0;         // Before Camera::ShutterFraction.
  float wavelengths = 0;  // For WavelengthSampler.
};
PassSample MakePassSample(uint64_t seed, uint64_t pass, bool one_sequence);

}  // namespace sheaf::render
