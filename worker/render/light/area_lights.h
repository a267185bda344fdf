// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Lights with a surface: a struct for each shape. light_table_impl.h lists the kinds of lights and
// what each of them has.
#pragma once

#include <cstdint>

#include "common/math/vec.h"
#include "worker/render/light/choice/light_bounds.h"
#include "worker/render/light/emission.h"
#include "worker/render/light/shape_sampling.h"

namespace sheaf::render {

struct LightMaps;

// One emitter as the geometry passes it. It emits on the side of n (right-hand rule of v0 v1 v2 for
// triangles, outward for spheres, axis for disks), on both sides where two_sided.
// SampleArea: a point that is uniform by area; its wi is unused.
struct TriangleEmitter {
  Vec3f v0, v1, v2;
  Emission radiance;
  bool two_sided = false;

  bool IsInward() const { return false; }
  double Area() const;
  ShapePoint SampleArea(Vec2f u) const;
  LightBounds Bounds(const LightMaps& maps) const;
  double Power(const LightMaps& maps, double cross_section) const;
};
struct SphereEmitter {
  Vec3d center;
  double radius = 1;
  Emission radiance;
  bool two_sided = false, inward = false;

  bool IsInward() const { return inward; }
  double Area() const;
  ShapePoint SampleArea(Vec2f u) const;
  LightBounds Bounds(const LightMaps& maps) const;
  double Power(const LightMaps& maps, double cross_section) const;
};
struct DiskEmitter {
  Vec3d center;
  Vec3d normal, axis_x;
  double radius = 1, inner_radius = 0;
  Emission radiance;
  bool two_sided = false;

  bool IsInward() const { return false; }
  double Area() const;
  ShapePoint SampleArea(Vec2f u) const;
  LightBounds Bounds(const LightMaps& maps) const;
  double Power(const LightMaps& maps, double cross_section) const;
};
// Partial or non-uniformly scaled spheres and disks are passed as triangles.

// How the emission of one emitter varies over its surface.
struct EmissionDetail {
  int32_t map = kNone;  // In LightTableInput::maps: the radiance, in place of Emission.
  float map_scale = 1;
  int32_t cut_out = kNone;  // Shape of SceneDescription whose alpha cuts out the emitter.
  bool is_unseen = false;   // Cut out everywhere: emits, but no ray hits it (pbrt-v4's rule).
  int32_t quadric = kNone;  // In LightTableInput::quadrics; kNone for a triangle.
  Vec2f uv[3];              // At the triangle's corners.
};

}  // namespace sheaf::render
