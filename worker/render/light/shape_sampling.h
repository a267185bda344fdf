// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Samples points on triangles, spheres and disks as seen from a receiver at p, with pdfs in solid
// angle. Every shape has a View, which holds everything that depends on (shape, p) only, so that
// sampling and evaluation choose the same technique and give bit-identical pdfs. Inputs are floats;
// the arithmetic is in double, so differences are exact and no formula breaks down at any distance
// or size. Space: any, the same for all arguments.
//
// A View is not `visible` where the receiver lies in the shape's plane to within the rounding of
// the coordinates (no constant depends on the scene's scale), or where the shape has no size; the
// pdf is then 0 and there is nothing to sample.
#pragma once

#include "common/math/vec.h"

namespace sheaf::render {

struct ShapePoint {
  Vec3d wi;  // Unit, from the receiver to the point.
  Vec3d p;   // On the shape.
  Vec3d n;   // Unit geometric normal of the shape there.
};

// --- Triangles ---------------------------------------------------------------------------------

// Below this solid angle sampling is by area: the light is a point in float precision.
inline constexpr double kTriangleSolidAngleMin = 1e-14;

struct TriangleView {
  Vec3d a, e1, e2;    // v0 - p, v1 - v0, v2 - v0.
  Vec3d normal_area;  // Cross(e1, e2): twice the area, on the emitting side.
  double triple = 0;  // Dot(a, normal_area); negative on the front side.
  double length_a = 0, length_b = 0, length_c = 0;  // Distances of the vertices.
  double solid_angle = 0;
  bool visible = false;
  bool by_area = false;
  bool front() const { return triple < 0; }
};
// Solid angle by Van Oosterom and Strackee 1983, with the triple product formed from edges.
TriangleView ViewTriangle(Vec3f v0, Vec3f v1, Vec3f v2, Vec3f p);
// Samples uniformly in solid angle, or in area if by_area. Source: Arvo 1995; Peters 2021, "BRDF
// Importance Sampling for Polygonal Lights", the half-angle form; here with differences in place of
// 1 - cos. Requires: view.visible.
ShapePoint SampleTriangle(const TriangleView& view, Vec3f v0, Vec3f p, Vec2f u);
// p_light: a point of the triangle. 0 where not visible.
double PdfTriangle(const TriangleView& view, Vec3f p, Vec3f p_light);

// --- Spheres -----------------------------------------------------------------------------------

struct SphereView {
  Vec3d to_center;               // center - p.
  double distance = 0;           // To the center.
  double sin_max_squared = 0;    // (radius / distance)^2, at most 1.
  double one_minus_cos_max = 0;  // For the cone that bounds the sphere.
  double pdf = 0;                // Constant over the sphere.
  double error = 0;              // Rounding error bound of distances.
  bool visible = false;
  bool inside = false;
};
// from_inside: the side from which p views the sphere if p is on its surface to within rounding.
SphereView ViewSphere(Vec3d center, double radius, bool from_inside, Vec3f p);
// Samples uniformly in the cone from outside, and over all directions from inside. n points
// outward. Requires: view.visible.
ShapePoint SampleSphere(const SphereView& view, Vec3d center, double radius, Vec2f u);

// --- Disks -------------------------------------------------------------------------------------

// Disks closer than this many radii (to the center) are sampled about the receiver's foot point.
inline constexpr double kDiskPolarDistance = 4;

struct DiskShapeView {
  Vec3d normal, axis_x, axis_y;  // Orthonormal; axis_x points from the foot point to the center.
  Vec3d foot;                    // The receiver projected onto the disk's plane.
  double radius = 0, inner_radius = 0;
  double height = 0;   // The receiver's height above the plane; positive on the front side.
  double offset = 0;   // Distance from the foot point to the center.
  double phi_max = 0;  // Half the angle the disk spans about the foot point.
  bool visible = false;
  bool by_area = false;
  bool front() const { return height > 0; }
};
// normal and axis_x: unit, orthogonal.
DiskShapeView ViewDisk(Vec3d center, Vec3d normal, Vec3d axis_x, double radius, double inner_radius,
                       Vec3f p);
// Samples distant disks uniformly in area; near ones uniformly in the angle about the foot point
// and, along the chord at that angle, in solid angle: weights are bounded at any distance. Sets
// *hit to false where the point is in the hole. Requires: view.visible.
ShapePoint SampleDisk(const DiskShapeView& view, Vec3f p, Vec2f u, bool* hit);
// wi: unit, from p to p_light, a point of the disk. 0 where not visible.
double PdfDisk(const DiskShapeView& view, Vec3f p, Vec3f wi, Vec3f p_light);

}  // namespace sheaf::render
