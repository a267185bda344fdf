// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RayKind: the kinds of rays that a shape or a light may be invisible to. The kind of a ray is that
// of the event where it begins; it keeps it through surfaces that do not scatter. Source: the ray
// visibility of Blender's Cycles (docs/adr/0330).
#pragma once

#include <cstdint>

namespace sheaf {

enum class RayKind : uint8_t {
  kCamera = 1 << 0,        // From the camera.
  kDiffuse = 1 << 1,       // Scattered back by a diffuse lobe, or out of a subsurface medium.
  kGlossy = 1 << 2,        // Reflected by any other lobe.
  kTransmission = 1 << 3,  // Scattered to the other side of a surface.
  kVolume = 1 << 4,        // Scattered by a medium.
  kShadow = 1 << 5,        // From any of these events but the camera to a light.
};

// A set of kinds.
using RayKinds = uint8_t;
constexpr RayKinds BitOf(RayKind kind) { return static_cast<RayKinds>(kind); }

struct RayKindName {
  RayKind kind;
  const char* name;
};
inline constexpr RayKindName kRayKindNames[] = {
    {RayKind::kCamera, "camera"}, {RayKind::kDiffuse, "diffuse"},
    {RayKind::kGlossy, "glossy"}, {RayKind::kTransmission, "transmission"},
    {RayKind::kVolume, "volume"}, {RayKind::kShadow, "shadow"},
};

// The kinds that a scattering event begins.
inline constexpr RayKinds kScatteredRays = BitOf(RayKind::kDiffuse) | BitOf(RayKind::kGlossy) |
                                           BitOf(RayKind::kTransmission) | BitOf(RayKind::kVolume);

}  // namespace sheaf
