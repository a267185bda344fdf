// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// How textures lie on surfaces, and textures that are computed from the place instead of read from
// a file, as pbrt-v4 defines them. Source: Pharr, Jakob, Humphreys, Physically Based Rendering, 3rd
// ed., section 10.6, and pbrt-v4's file format. Readers check every range that stands here.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/math/transform.h"
#include "common/math/vec.h"
#include "common/scene/material_description.h"

namespace sheaf {

struct UvMapping {
  // kSecondUv is as kUv, of the first two numbers of the vertices' color: a mesh without colors of
  // its own carries its second set of uv there.
  enum class Kind { kUv, kPlanar, kSpherical, kCylindrical, kSecondUv };
  Kind kind = Kind::kUv;
  float scale_u = 1, scale_v = 1, offset_u = 0, offset_v = 0;
  // kUv and kSecondUv also add turn_u * v to u, and turn_v * u to v: a rotation, with the scales.
  float turn_u = 0, turn_v = 0;
  Vec3f planar_u{1, 0, 0}, planar_v{0, 1, 0};
  Matrix4 texture_from_world;  // For mappings by position, and for textures of three dimensions.
};

// A sum of octaves of gradient noise over texture space; a float texture.
struct NoiseTexture {
  enum class Kind {
    kFbm,       // The octaves themselves ("fbm").
    kWrinkled,  // Their absolute values ("wrinkled").
    kWindy,     // Six octaves, scaled by the absolute value of three that are ten times as wide.
  };
  static constexpr int32_t kOctavesMax = 32;
  Kind kind = Kind::kFbm;
  int32_t octaves = 8;     // From 1 to kOctavesMax; unused by kWindy.
  float roughness = 0.5f;  // The amplitude of each octave, relative to the previous one.
  Matrix4 texture_from_world;
};
// Veins: a curve of colors over the sine of the place's y and of noise; a color texture.
struct MarbleTexture {
  int32_t octaves = 8;  // As for NoiseTexture.
  float roughness = 0.5f;
  float scale = 1;         // Multiplies the place.
  float variation = 0.2f;  // The noise's amplitude.
  Matrix4 texture_from_world;
};
// The first input in discs of radius 0.35 about random points, in about two of five unit squares,
// and the second around them.
struct DotsTexture {
  UvMapping mapping;
  ColorInput color[2];
  FloatInput value[2];
};
// The first input where the geometric normal is along the direction (or against it), the second
// where it is across; between, they are mixed by the absolute value of the cosine.
struct DirectionMixTexture {
  Vec3f direction{0, 1, 0};  // A unit vector in world space.
  ColorInput color[2];
  FloatInput value[2];
};
// The bilinear function of s and t that has these values at (0, 0), (1, 0), (0, 1) and (1, 1).
struct BilerpTexture {
  UvMapping mapping;
  ColorSpec color[4];
  float value[4] = {0, 0, 1, 1};
};

// A texture node of Blender; its factor as a float texture, its color as a color texture.
struct NodeTexture {
  enum class Kind : uint8_t {
    kNoise,
    kMusgrave,
    kVoronoi,
    kWave,
    kMagic,
    kBrick,
    kGradient,
    kWhiteNoise,
    kAttribute  // The color that a mesh gives its vertices, wherever the place is.
  };
  static constexpr size_t kNumbers = 13;
  Kind kind = Kind::kNoise;
  bool from_uv = false;        // The place is (u, v, 0) instead of a point in world space.
  Matrix4 texture_from_place;  // Affine.
  // In the order of the node's parameters (node_parameters.h), which the reader checks.
  std::array<float, kNumbers> numbers{};
};
// A function of a number, linear or constant between stops; beyond them as at the last one.
struct RampTexture {
  static constexpr size_t kStopsMax = 1024;
  struct Stop {
    float position = 0;
    Rgb color;
    float value = 0;
  };
  FloatInput input;
  std::vector<Stop> stops;  // At least one, in the order of their positions.
  bool is_stepped = false;  // Each stop's color holds up to the next one.
};

}  // namespace sheaf
