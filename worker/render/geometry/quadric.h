// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Exact spheres, cylinders and disks, whole or partial, under any affine transform: intersected in
// object space in double. The distance of closest approach comes from the perpendicular from the
// centre (or the axis) to the ray, which keeps its digits however far the ray starts. Source:
// Haines et al. 2019, "Precision Improvements for Ray/Sphere Intersection", Ray Tracing Gems ch. 7;
// parametrisation after pbrt-v4, ch. 6.2 to 6.4.
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
  Vec3f coordinate_max;  // No coordinate met on the way to a point is larger: for error bounds.
};

// A shape as written, its ranges clamped and put in order; the transforms are left as identities.
Quadric MakeQuadric(const SphereShape& sphere);
Quadric MakeQuadric(const DiskShape& disk);
Quadric MakeQuadric(const CylinderShape& cylinder);

// The least t in (0, t_max) at which o + t d (target space) meets the quadric.
std::optional<double> IntersectQuadric(const Quadric& quadric, Vec3d o, Vec3d d, double t_max);

// A point of the quadric itself: o + t d (target space) moved onto it along the object-space
// radius, or the disk's normal.
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
// What Quadric::coordinate_max has to be, given those bounds.
Vec3f QuadricCoordinateMax(const Quadric& quadric, const std::array<Vec3f, 2>& bounds);

}  // namespace sheaf::render
