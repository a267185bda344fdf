// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Intensity and radiance of lights without a surface, for the files that sample them.
#pragma once

#include "worker/render/light/light_table_impl.h"

namespace sheaf::render {

// Intensity of a light at a point along the unit direction w, which leaves the light.
template <typename Color, typename AtPoint>
Color IntensityAlong(const LightTable::Impl& impl, const AtPoint& light, Vec3f w,
                     const WavelengthsOf<Color>& wavelengths) {
  return impl.ColorTimes<Color>(light.emission, light.FalloffAlong(impl.light_maps, w),
                                wavelengths);
}

// place: the direction's place in the map, if there is a map.
template <typename Color>
Color RadianceAt(const LightTable::Impl& impl, const InfiniteEmitter& light,
                 EnvironmentMap::Place place, const WavelengthsOf<Color>& wavelengths) {
  if (!light.map) return impl.ColorOfEmission(light.radiance, wavelengths);
  const Rgb radiance = light.map->Radiance(place) * light.scale;
  return ColorOfRgb<Color>(radiance, ColorRole::kIlluminant, wavelengths);
}

}  // namespace sheaf::render
