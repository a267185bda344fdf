// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Gradient noise and sums of its octaves, for procedural textures. The noise is Perlin's of 2002
// with his permutation, so that a pattern lies where pbrt-v4 has it. Only +, -, * and floor are
// used: the bits are the same on any machine.
//
// Sources: Perlin 2002, "Improving noise"; Pharr, Jakob, Humphreys, Physically Based Rendering, 3rd
// ed., section 10.6.
//
// Thread safety: pure functions.
#pragma once

#include "common/math/vec.h"

namespace sheaf {

// In [-1, 1], 0 where all coordinates are integers, and repeated after 256 units along each axis.
// Twice continuously differentiable. Coordinates that are not finite count as 0.
double PerlinNoise(Vec3d p);

// Octaves: each has `roughness` times the amplitude of the previous one, and kLacunarity times the
// frequency, so that lattice points of octaves do not meet. The first one has amplitude 1.
inline constexpr double kLacunarity = 1.99;
// The sum of the octaves. Requires: octaves >= 0.
double FractalNoise(Vec3d p, int octaves, double roughness);
// The sum of their absolute values.
double TurbulentNoise(Vec3d p, int octaves, double roughness);

}  // namespace sheaf
