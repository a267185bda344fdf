// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Bounds of static and moving placed groups.
#include <algorithm>

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

}  // namespace

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
  // The tracer interpolates boxes linearly between steps; the margin covers the deviation. The
  // group's points are relative to its center, so the center's own path adds to the radius.
  const double radius = group.radius + Length(motion.group_center);
  const double margin =
      std::max(motion.world_from_placed.LinearDeviationMax(time, time + duration, radius),
               motion.world_from_placed.LinearDeviationMax(time - duration, time, radius));
  return RoundOut(MapBox(motion.RenderFromGroup(time), group.bounds_lower, group.bounds_upper),
                  margin);
}

}  // namespace sheaf::render
