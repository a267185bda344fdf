// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// DeltaLight: a light without size, or at infinity in one direction; a struct for each kind. A new
// kind is a struct here, its functions in delta_lights.cc, and its name in DeltaLight. Beside what
// every light has (light_table_impl.h), a light at a point has
//   FalloffAlong(maps, w): the factor of its intensity along the unit direction w, which leaves
//     the light; Rgb where it has a color.
//   SampleDirection(samplers, u): a direction in which it emits, by the factor's luminance. Not
//     unit.
//   DirectionPdf(samplers, w): the density of that along w (unit), per solid angle.
// Space: render, unless a name says otherwise.
#pragma once

#include <cstddef>
#include <cstdint>
#include <variant>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/light/choice/light_bounds.h"
#include "worker/render/light/emission.h"
#include "worker/render/light/intensity_map.h"
#include "worker/render/light/intensity_sampling.h"
#include "worker/render/light/photometric_web.h"
#include "worker/render/light/projected_image.h"

namespace sheaf::render {

// Factor of a goniometric light's intensity by direction.
using IntensityDistribution = std::variant<IntensityMap, PhotometricWeb>;

// Maps of intensity by direction, which lights share.
struct LightMaps {
  std::vector<IntensityDistribution> intensities;
  std::vector<ProjectedImage> projected;
};

// Samplers of directions by these maps, under the same indices.
struct ImageSamplers {
  std::vector<std::variant<MapDirections, WebDirections>> intensities;
  std::vector<ImageDirections> projected;
};

struct DistantEmitter {
  static constexpr bool kIsDistant = true;
  Vec3f to_light;               // Unit, towards the light.
  Emission emission;            // Irradiance on a facing plane.
  int32_t description = kNone;  // Index in SceneDescription::lights.

  LightBounds Bounds(const LightMaps& maps) const;
  double Power(const LightMaps& maps, double cross_section) const;
};

struct LightAtPoint {
  static constexpr bool kIsDistant = false;
  Vec3d position;
  Emission emission;            // Intensity.
  int32_t description = kNone;  // As DistantEmitter::description.
};

// Intensity by direction in a space of the light's own.
struct OrientedLight : LightAtPoint {
  Vec3f light_from_render[3];  // Rows of a linear map.
};

struct PointEmitter : LightAtPoint {
  float FalloffAlong(const LightMaps&, Vec3f) const { return 1; }
  Vec3d SampleDirection(const ImageSamplers& samplers, Vec2f u) const;
  double DirectionPdf(const ImageSamplers& samplers, Vec3f w) const;
  LightBounds Bounds(const LightMaps& maps) const;
  double Power(const LightMaps& maps, double cross_section) const;
};

struct SpotEmitter : OrientedLight {
  Vec3f axis;  // Unit, in the light's space.
  // It falls off smoothly between these cosines with the axis.
  float cos_start = 1, cos_end = 1;

  float FalloffAlong(const LightMaps& maps, Vec3f w) const;
  Vec3d SampleDirection(const ImageSamplers& samplers, Vec2f u) const;
  double DirectionPdf(const ImageSamplers& samplers, Vec3f w) const;
  LightBounds Bounds(const LightMaps& maps) const;
  double Power(const LightMaps& maps, double cross_section) const;
};

struct GoniometricEmitter : OrientedLight {
  size_t image = 0;  // Index in LightMaps::intensities.

  float FalloffAlong(const LightMaps& maps, Vec3f w) const;
  Vec3d SampleDirection(const ImageSamplers& samplers, Vec2f u) const;
  double DirectionPdf(const ImageSamplers& samplers, Vec3f w) const;
  LightBounds Bounds(const LightMaps& maps) const;
  double Power(const LightMaps& maps, double cross_section) const;
};

// Its emission is a gray factor of its image, which it throws along +z of its space.
struct ProjectionEmitter : OrientedLight {
  size_t image = 0;   // Index in LightMaps::projected.
  float cos_end = 1;  // Zero beyond this cosine with +z.

  Rgb FalloffAlong(const LightMaps& maps, Vec3f w) const;
  Vec3d SampleDirection(const ImageSamplers& samplers, Vec2f u) const;
  double DirectionPdf(const ImageSamplers& samplers, Vec3f w) const;
  LightBounds Bounds(const LightMaps& maps) const;
  double Power(const LightMaps& maps, double cross_section) const;
};

using DeltaLight =
    std::variant<PointEmitter, SpotEmitter, DistantEmitter, GoniometricEmitter, ProjectionEmitter>;

inline bool IsDistant(const DeltaLight& light) {
  return std::visit([](const auto& kind) { return kind.kIsDistant; }, light);
}

}  // namespace sheaf::render
