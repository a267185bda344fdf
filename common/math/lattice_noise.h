// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The noise of Blender's texture nodes: gradient noise like Perlin's, whose gradients a hash of the
// lattice points chooses, and random numbers of places. Integers and IEEE 754 operations alone: the
// bits are the same on any machine.
//
// Sources: Perlin 2002, "Improving noise"; Jenkins 2006, lookup3 (the mixing of the hash); the
// scales and seeds of Blender's nodes, so that a pattern lies where Blender has it.
//
// Thread safety: pure functions.
#pragma once

#include <array>
#include <cstdint>

#include "common/math/vec.h"

namespace sheaf {

// Hashes of the keys, and a number in [0, 1] of the bits of floats.
uint32_t HashOf(uint32_t x);
uint32_t HashOf(uint32_t x, uint32_t y);
uint32_t HashOf(uint32_t x, uint32_t y, uint32_t z);
uint32_t HashOf(uint32_t x, uint32_t y, uint32_t z, uint32_t w);
float RandomOf(float x);
float RandomOf(float x, float y);
float RandomOf(float x, float y, float z);
float RandomOf(float x, float y, float z, float w);
// Three numbers of a place in one to four dimensions, and four of one in four.
std::array<float, 3> RandomTripleOf(float x);
std::array<float, 3> RandomTripleOf(float x, float y);
std::array<float, 3> RandomTripleOf(float x, float y, float z);
std::array<float, 3> RandomTripleOf(float x, float y, float z, float w);
std::array<float, 4> RandomQuadrupleOf(float x, float y, float z, float w);

// Within about [-1, 1], 0 at integers. Coordinates beyond 2^31 and such that are no numbers count
// as 0.
double LatticeNoise(double x);
double LatticeNoise(Vec2d p);
double LatticeNoise(Vec3d p);
double LatticeNoise(Vec3d p, double w);

}  // namespace sheaf
