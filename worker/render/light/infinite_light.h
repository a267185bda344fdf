// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// InfiniteEmitter: a light from all directions.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>

#include "common/math/elementary.h"
#include "worker/render/light/choice/light_bounds.h"
#include "worker/render/light/emission.h"
#include "worker/render/light/environment_map.h"
#include "worker/render/light/light_space.h"
#include "worker/render/light/sky_portal.h"

namespace sheaf::render {

struct LightMaps;

// Constant where it has no map.
struct InfiniteEmitter {
  std::optional<EnvironmentMap> map;
  Emission radiance;            // Constant.
  float scale = 1;              // Scale of the map; 1 where there is none.
  int32_t description = kNone;  // Index in SceneDescription::lights.
  Vec3f light_from_render[3];   // Rows of a rotation (or reflection).
  // If present, only light that arrives through it counts. Requires a map.
  std::optional<SkyPortal> portal;

  // The place in the map, if there is one, of a direction in render space.
  EnvironmentMap::Place PlaceOf(Vec3f d) const {
    if (!map) return {};
    return map->Locate(Rotate(light_from_render, d));
  }
  // Unit, in render space. Requires: map.
  Vec3f DirectionOf(EnvironmentMap::Place place) const {
    return ToFloat(RotateBack(light_from_render, map->Direction(place)));
  }
  // The pdf of the direction at the place, per solid angle. Without the portal.
  double Pdf(EnvironmentMap::Place place) const {
    return map ? static_cast<double>(map->Pdf(place)) : 1 / (4 * kPi);
  }

  LightBounds Bounds(const LightMaps&) const {
    const float mean =
        map ? static_cast<float>(map->mean_luminance()) * scale : StrengthOf(radiance.rgb);
    return {.kind = LightBounds::Kind::kInfinite,
            .strength = static_cast<float>(kPi) * std::fabs(mean)};
  }
  double Power(const LightMaps&, double cross_section) const {
    const double mean = map ? map->mean_luminance() * static_cast<double>(std::fabs(scale))
                            : static_cast<double>(StrengthOf(radiance.rgb));
    if (portal) return kPi * portal->Area() * mean;
    return 4 * kPi * cross_section * mean;
  }
};

}  // namespace sheaf::render
