// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Exact spheres, cylinders and disks, whole or partial, under any affine transform: intersected in
// object space in double. The distance of closest approach comes from the perpendicular from the
// center (or the axis) to the ray, which keeps its precision at any distance of the ray's origin.
// Source: Haines et al. 2019, "Precision Improvements for Ray/Sphere Intersection", Ray Tracing
// Gems ch. 7; parametrization after pbrt-v4, ch. 6.2 to 6.4.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "common/math/vec.h"
#include "common/scene/scene_description.h"
#include "worker/render/geometry/affine.h"

namespace sheaf::render {

struct Quadric {
  enum class Kind : uint8_t { kSphere, kDisk, kCylinder } kind = Kind::kSphere;
  bool is_partial = false;  // Cut by z, phi or an inner radius.
  double radius = 1;
  double z_min = -1, z_max = 1;  // A disk lies at z_min.
  double inner_radius = 0;       // Disks.
  double phi_max = 0;            // Radians.
  Affine target_from_object, object_from_target;
  Vec3f coordinate_max;  // Bound of all coordinates that lead to a point: for error bounds.
};

// Converts a shape as written: clamps and sorts its ranges, and leaves the transforms as
// identities.
Quadric MakeQuadric(const SphereShape& sphere);
Quadric MakeQuadric(const DiskShape& disk);
Quadric MakeQuadric(const CylinderShape& cylinder);

// Returns the least t in (0, t_max) at which o + t d (target space) intersects the quadric.
std::optional<double> IntersectQuadric(const Quadric& quadric, Vec3d o, Vec3d d, double t_max);

// A point on the quadric: o + t d (target space) projected onto it along the object-space radius or
// the disk's normal.
struct QuadricPoint {
  Vec3d p;  // Target space.
  Vec3d n;  // Unit, target space; outward, or along the image of +z (disks).
  Vec3d p_object;
};
QuadricPoint QuadricPointAt(const Quadric& quadric, Vec3d o, Vec3d d, double t);

struct QuadricParameters {
  Vec2f uv;
  Vec3d dpdu, dpdv;  // Target space.
};
QuadricParameters QuadricParametersAt(const Quadric& quadric, Vec3d p_object);

// Axis-aligned bounds in target space, rounded outwards to float: lower, upper.
std::array<Vec3f, 2> QuadricBounds(const Quadric& quadric);
// The value of Quadric::coordinate_max for the given bounds.
Vec3f QuadricCoordinateMax(const Quadric& quadric, const std::array<Vec3f, 2>& bounds);

}  // namespace sheaf::render
