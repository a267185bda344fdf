// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Bounds of static and moving placed groups.
#include <algorithm>
#include <cmath>

#include "common/math/next_float.h"
#include "worker/render/geometry/bounds.h"
#include "worker/render/geometry/scene_geometry.h"

namespace sheaf::render {
namespace {

// Bounds of the corners of a box under an affine map.
Bounds MapBox(const Affine& transform, Vec3f lower, Vec3f upper) {
  Bounds bounds;
  for (int corner = 0; corner < 8; ++corner) {
    bounds.Add(transform.Point({corner & 1 ? upper.x : lower.x, corner & 2 ? upper.y : lower.y,
                                corner & 4 ? upper.z : lower.z}));
  }
  return bounds;
}

PlacedBounds RoundOut(const Bounds& bounds, double margin) {
  PlacedBounds box;
  for (size_t i = 0; i < 3; ++i) {
    box.lower[i] = NextDown(static_cast<float>(bounds.lower()[i] - margin));
    box.upper[i] = NextUp(static_cast<float>(bounds.upper()[i] + margin));
  }
  return box;
}

// Frobenius norm of the linear part.
double NormOf(const Affine& a) {
  return std::sqrt(LengthSquared(a.x) + LengthSquared(a.y) + LengthSquared(a.z));
}

// Without the offset.
Affine LinearDifference(const Affine& a, const Affine& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z, {0, 0, 0}};
}

}  // namespace

double GroupMotion::LinearDeviationMax(double time_0, double time_1, double radius) const {
  // The group's points are relative to its center, so the center's own path adds to the radius.
  const double reach = radius + Length(group_center);
  if (!placed_from_shape.has_value()) {
    return world_from_placed.LinearDeviationMax(time_0, time_1, reach);
  }
  // The path is A(t) s(t). Where A and s were straight, their product would deviate from its chord
  // by a quarter of (A1 - A0)(s1 - s0) at most; their own deviations add to that.
  const Affine s0 = placed_from_shape->At(time_0), s1 = placed_from_shape->At(time_1);
  const Affine a0 = world_from_placed.At(time_0), a1 = world_from_placed.At(time_1);
  const double inner = placed_from_shape->LinearDeviationMax(time_0, time_1, reach);
  const double inner_reach = std::max(NormOf(s0), NormOf(s1)) * reach +
                             std::max(Length(s0.offset), Length(s1.offset)) + inner;
  const double way = NormOf(LinearDifference(s1, s0)) * reach + Length(s1.offset - s0.offset);
  return world_from_placed.LinearDeviationMax(time_0, time_1, inner_reach) +
         std::max(NormOf(a0), NormOf(a1)) * inner + 0.25 * NormOf(LinearDifference(a1, a0)) * way;
}

PlacedBounds BoundsOfStill(const SceneGeometry& geometry, const PlacedGroup& placed) {
  const GeometryGroup& group = geometry.groups[placed.group];
  return RoundOut(MapBox(placed.render_from_group, group.bounds_lower, group.bounds_upper), 0);
}

PlacedBounds BoundsOfMoving(const SceneGeometry& geometry, const PlacedGroup& placed,
                            uint32_t step) {
  const GeometryGroup& group = geometry.groups[placed.group];
  const GroupMotion& motion = geometry.motions[placed.motion];
  const double duration = (geometry.shutter_close - geometry.shutter_open) / (kMotionStepCount - 1);
  const double time = geometry.shutter_open + duration * step;
  // The tracer interpolates boxes linearly between steps; the margin covers the deviation.
  const double margin = std::max(motion.LinearDeviationMax(time, time + duration, group.radius),
                                 motion.LinearDeviationMax(time - duration, time, group.radius));
  return RoundOut(MapBox(motion.RenderFromGroup(time), group.bounds_lower, group.bounds_upper),
                  margin);
}

}  // namespace sheaf::render
