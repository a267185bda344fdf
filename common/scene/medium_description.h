// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Participating media as a scene file describes them: plain values, as written after the format's
// defaults. A medium is a substance; where it is say the surfaces that bound it.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "common/math/transform.h"
#include "common/math/vec.h"
#include "common/scene/color_spec.h"

namespace sheaf {

// The same everywhere.
struct HomogeneousMedium {};
// Values at the centres of equal cells of the box from p0 to p1 (medium space); x runs fastest.
// Nothing is there outside of the box.
struct GridBox {
  std::array<int32_t, 3> counts{1, 1, 1};
  Vec3d p0{0, 0, 0}, p1{1, 1, 1};
  size_t size() const {
    return static_cast<size_t>(counts[0]) * static_cast<size_t>(counts[1]) *
           static_cast<size_t>(counts[2]);
  }
};
// What is colder does not shine. Source: pbrt-v4.
inline constexpr float kGlowTemperatureMinK = 100;
// How temperatures shine: as a black body of (value - offset_k) * scale, where that is over
// kGlowTemperatureMinK.
struct TemperatureEmission {
  float offset_k = 0, scale = 1;
  float KelvinOf(float value) const { return (value - offset_k) * scale; }
};
struct UniformGridMedium {
  GridBox box;
  std::vector<float> density;         // One per cell; multiplies sigma_a and sigma_s.
  std::vector<float> temperature_k;   // Empty or one per cell.
  std::vector<float> radiance_scale;  // Empty or one per cell; multiplies the radiance.
  TemperatureEmission emission;
  std::vector<Vec3f> velocity;  // Empty or one per cell; see MediumDescription::velocity_scale.
};
struct RgbGridMedium {
  GridBox box;
  // Empty or one per cell, in place of the medium's own; sigma_a and sigma_s are 1 where empty.
  std::vector<Rgb> sigma_a, sigma_s, radiance;
};
// pbrt-v4's procedural cloud in the box from p0 to p1.
struct CloudMedium {
  Vec3d p0{0, 0, 0}, p1{1, 1, 1};
  float density = 1, wispiness = 1, frequency = 5;
};
// Density (and temperature, where the file has one) from a file of sparse voxels.
struct VolumeFileMedium {
  std::string file;         // Canonical name for FileSource.
  bool is_openvdb = false;  // .vdb; otherwise .nvdb.
  TemperatureEmission emission;
  // The grid of velocities. Empty: it stands still.
  std::string velocity_grid;
};
// As a velocity_grid: the first of kVelocityGridNames that the file has.
inline constexpr char kAnyVelocityGrid[] = "auto";
inline constexpr std::array<const char*, 3> kVelocityGridNames{"velocity", "vel", "v"};

// Matter by what it gives back of even light that has entered it (half_space.h).
struct MatterReflectance {
  ColorSpec color;
  int32_t texture = kNone;  // Index in textures, instead of color: read where a path enters.
  ColorSpec free_path;      // Mean, in scene units before scale.
  float scale = 1;          // Of the free path.
  float eta = 1;            // Of the boundary.
};

struct MediumDescription {
  std::string name;
  std::variant<HomogeneousMedium, UniformGridMedium, RgbGridMedium, CloudMedium, VolumeFileMedium>
      kind;
  // Absorbed and scattered per scene unit of world space, before scale.
  ColorSpec sigma_a, sigma_s;
  float scale = 1;  // Of both.
  // Mean cosine of the scattering angle of the phase function of Henyey and Greenstein.
  float g = 0;
  bool emits = false;        // Then what is absorbed over a length is emitted over it, in units of
  ColorSpec radiance;        // this (an illuminant)
  float radiance_scale = 1;  // times this. Grids of temperatures use radiance_scale only.
  // The inside of a material: scattering there counts no depth, and every path in it must come to
  // the boundary. Homogeneous.
  bool is_matter = false;
  // Set for matter that is given so, by SetReflectance (matter_reflectance.h). Then sigma_a and
  // sigma_s follow from it as linear sRGB; where it is textured, from a reflectance of 1.
  std::optional<MatterReflectance> reflectance;
  // Of velocities, which are in medium space, per unit of the time that the shutter is given in.
  // What is there when the shutter opens moves by them while it is open.
  float velocity_scale = 1;
  // Of a grid with one value in all cells: what was made of it, and why. See constant_grid.h.
  std::string constant_grid;
  Matrix4 world_from_medium;
  SourceLocation location;

  bool IsHomogeneous() const { return std::holds_alternative<HomogeneousMedium>(kind); }
  // Whether there are velocities, in a file maybe of 0.
  bool Moves() const {
    if (velocity_scale == 0) return false;
    if (const auto* grid = std::get_if<UniformGridMedium>(&kind)) return !grid->velocity.empty();
    const auto* volume = std::get_if<VolumeFileMedium>(&kind);
    return volume != nullptr && !volume->velocity_grid.empty();
  }
  void StandStill() {
    if (auto* grid = std::get_if<UniformGridMedium>(&kind)) grid->velocity.clear();
    if (auto* volume = std::get_if<VolumeFileMedium>(&kind)) volume->velocity_grid.clear();
  }
};

// What |g| may be at most: beyond, the phase function is narrower than float directions can tell.
inline constexpr float kPhaseAsymmetryMax = 0.999f;

// The media on the two sides of a surface, as indices in SceneDescription::media. Both are kNone
// where it bounds none. The front of the surface is outside.
struct MediumBoundary {
  int32_t inside = kNone, outside = kNone;
  bool Separates() const { return inside != outside; }
};

}  // namespace sheaf
