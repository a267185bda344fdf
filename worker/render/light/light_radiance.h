// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Intensity and radiance of lights without a surface, and their spaces, for the files that sample
// them.
#pragma once

#include <cmath>

#include "common/math/elementary.h"
#include "worker/render/light/light_table_impl.h"

namespace sheaf::render {

inline Vec3f Rotate(const Vec3f (&rows)[3], Vec3f v) {
  return {Dot(rows[0], v), Dot(rows[1], v), Dot(rows[2], v)};
}
inline Vec3d RotateBack(const Vec3f (&rows)[3], Vec3d v) {
  return v.x * ToDouble(rows[0]) + v.y * ToDouble(rows[1]) + v.z * ToDouble(rows[2]);
}

// Intensity of a light with a position along the unit direction w, which leaves the light.
template <typename Color>
Color IntensityAlong(const LightTable::Impl& impl, const DeltaLight& light, Vec3f w,
                     const WavelengthsOf<Color>& wavelengths) {
  if (light.kind == DeltaLight::Kind::kProjection) {
    const Rgb seen = impl.projected_images[light.image].At(Rotate(light.light_from_render, w));
    return ColorOfRgb<Color>(seen * light.emission.rgb, ColorRole::kIlluminant, wavelengths);
  }
  return impl.ColorOfEmission(light.emission, wavelengths) * FalloffAlong(impl, light, w);
}

inline EnvironmentMap::Place PlaceOf(const InfiniteEmitter& light, Vec3f d) {
  if (!light.map) return {};
  return light.map->Locate(Rotate(light.light_from_render, d));
}

// place: the direction's place in the map, if there is a map.
template <typename Color>
Color RadianceAt(const LightTable::Impl& impl, const InfiniteEmitter& light,
                 EnvironmentMap::Place place, const WavelengthsOf<Color>& wavelengths) {
  if (!light.map) return impl.ColorOfEmission(light.radiance, wavelengths);
  const Rgb radiance = light.map->Radiance(place) * light.scale;
  return ColorOfRgb<Color>(radiance, ColorRole::kIlluminant, wavelengths);
}

// Requires: light.map.
inline Vec3f DirectionOf(const InfiniteEmitter& light, EnvironmentMap::Place place) {
  return ToFloat(RotateBack(light.light_from_render, light.map->Direction(place)));
}

inline Vec3f UniformDirection(Vec2f u) {
  const double z = 1 - 2 * static_cast<double>(u.x);
  const double r = std::sqrt(1 - z * z);
  const SinCosPair<double> phi = SinCos(2 * kPi * static_cast<double>(u.y));
  return ToFloat({r * phi.cos, r * phi.sin, z});
}

}  // namespace sheaf::render
