// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Participating media as a scene file describes them: plain values, as written after the format's
// defaults. A medium is a substance; the surfaces that bound it say where it is.
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
// Values at the centers of equal cells of the box from p0 to p1 (medium space); x runs fastest. The
// medium is empty outside of the box.
struct GridBox {
  std::array<int32_t, 3> counts{1, 1, 1};
  Vec3d p0{0, 0, 0}, p1{1, 1, 1};
  size_t size() const {
    return static_cast<size_t>(counts[0]) * static_cast<size_t>(counts[1]) *
           static_cast<size_t>(counts[2]);
  }
};
// Colder temperatures emit nothing. Source: pbrt-v4.
inline constexpr float kEmissionTemperatureMinK = 100;
// Emission of temperatures: a blackbody at (value - offset_k) * scale, if that is above
// kEmissionTemperatureMinK.
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
  // Empty or one per cell, replacing the medium's own. sigma_a and sigma_s are 1 if empty.
  std::vector<Rgb> sigma_a, sigma_s, radiance;
};
// pbrt-v4's procedural cloud in the box from p0 to p1.
struct CloudMedium {
  Vec3d p0{0, 0, 0}, p1{1, 1, 1};
  float density = 1, wispiness = 1, frequency = 5;
};
// Density (and temperature, if the file has one) from a file of sparse voxels.
struct VolumeFileMedium {
  std::string file;         // Canonical name for FileSource.
  bool is_openvdb = false;  // .vdb; otherwise .nvdb.
  TemperatureEmission emission;
  // The grid of densities, by its name, which may be empty. Source of the default: pbrt-v4.
  std::string density_grid = "density";
  // The grid of temperatures. Not given: kTemperatureGrid, if the file has it.
  std::optional<std::string> temperature_grid;
  // The grid of velocities. Empty: the medium is at rest.
  std::string velocity_grid;
};
inline constexpr char kTemperatureGrid[] = "temperature";  // Source: pbrt-v4.
// Value of velocity_grid: the first of kVelocityGridNames that the file has.
inline constexpr char kAnyVelocityGrid[] = "auto";
inline constexpr std::array<const char*, 3> kVelocityGridNames{"velocity", "vel", "v"};

// A subsurface medium, given by the fraction of uniform light that leaves it again after entering
// (half_space.h).
struct SubsurfaceReflectance {
  ColorSpec color;
  int32_t texture = kNone;  // Index in textures, replacing color: evaluated where a path enters.
  ColorSpec free_path;      // Mean, in scene units before scale.
  float scale = 1;          // Multiplies the free path.
  float eta = 1;            // The boundary's index.
};

struct MediumDescription {
  std::string name;
  std::variant<HomogeneousMedium, UniformGridMedium, RgbGridMedium, CloudMedium, VolumeFileMedium>
      kind;
  // Absorption and scattering coefficients per scene unit of world space, before scale.
  ColorSpec sigma_a, sigma_s;
  float scale = 1;  // Multiplies both.
  // Mean cosine of the scattering angle of the Henyey-Greenstein phase function.
  float g = 0;
  bool emits = false;        // True: emits sigma_a * radiance * radiance_scale per unit length.
  ColorSpec radiance;        // An illuminant.
  float radiance_scale = 1;  // Temperature grids use this and no radiance.
  // The interior of a material: scattering there does not count towards the path's depth, and every
  // path in it must reach the boundary. Homogeneous.
  bool is_subsurface = false;
  // Set by SetReflectance (subsurface_reflectance.h) for subsurface media that are given by
  // reflectance. Then sigma_a and sigma_s follow from it as linear sRGB; if textured, from a
  // reflectance of 1.
  std::optional<SubsurfaceReflectance> reflectance;
  // Scale of the velocities, which are in medium space, per unit of the time in which the shutter
  // is given. The content at shutter opening moves along them while the shutter is open.
  float velocity_scale = 1;
  // For a grid with one value in all cells: whether it became homogeneous, and why. See
  // constant_grid.h.
  std::string constant_grid;
  Matrix4 world_from_medium;
  SourceLocation location;

  bool IsHomogeneous() const { return std::holds_alternative<HomogeneousMedium>(kind); }
  // Whether there are velocities; those in a file may all be 0.
  bool Moves() const {
    if (velocity_scale == 0) return false;
    if (const auto* grid = std::get_if<UniformGridMedium>(&kind)) return !grid->velocity.empty();
    const auto* volume = std::get_if<VolumeFileMedium>(&kind);
    return volume != nullptr && !volume->velocity_grid.empty();
  }
  void RemoveMotion() {
    if (auto* grid = std::get_if<UniformGridMedium>(&kind)) grid->velocity.clear();
    if (auto* volume = std::get_if<VolumeFileMedium>(&kind)) volume->velocity_grid.clear();
  }
};

// Maximum |g|: beyond, the phase function is narrower than float directions can resolve.
inline constexpr float kPhaseAsymmetryMax = 0.999f;

// The media on the two sides of a surface, as indices in SceneDescription::media. Both are kNone if
// it bounds none. The front of the surface is outside.
struct MediumBoundary {
  int32_t inside = kNone, outside = kNone;
  bool Separates() const { return inside != outside; }
};

}  // namespace sheaf
