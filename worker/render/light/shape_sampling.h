// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Points on triangles, spheres and disks as a receiver at p sees them, with pdfs in solid angle.
// Every shape has a View: all that depends on (shape, p) and nothing else, so that sampling and
// evaluating switch between techniques on the same bit and give the same pdf to the bit. Inputs are
// floats; the arithmetic between them is double, which makes differences exact and leaves no
// distance or size at which a form breaks down. Space: any, the same for all arguments.
//
// A View is not `visible` where the receiver cannot be told from a point in the shape's plane
// (within the rounding of the coordinates themselves; no scene-scale constant), and where the shape
// has no size: then there is nothing to sample and the pdf is 0.
#pragma once

#include "common/math/vec.h"

namespace sheaf::render {

struct ShapePoint {
  Vec3d wi;  // Unit, from the receiver to the point.
  Vec3d p;   // On the shape.
  Vec3d n;   // Unit geometric normal of the shape there.
};

// --- Triangles ---------------------------------------------------------------------------------

// Solid angles below this are sampled by area: the light is a point to any float there.
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
// Uniform in solid angle, else in area. Source: Arvo 1995; Peters 2021, "BRDF Importance Sampling
// for Polygonal Lights", the half-angle form; here with differences in place of 1 - cos. Requires:
// view.visible.
ShapePoint SampleTriangle(const TriangleView& view, Vec3f v0, Vec3f p, Vec2f u);
// p_light: a point of the triangle. 0 where not visible.
double PdfTriangle(const TriangleView& view, Vec3f p, Vec3f p_light);

// --- Spheres -----------------------------------------------------------------------------------

struct SphereView {
  Vec3d to_center;               // center - p.
  double distance = 0;           // Of the centre.
  double sin_max_squared = 0;    // (radius / distance)^2, at most 1.
  double one_minus_cos_max = 0;  // Of the cone that holds the sphere.
  double pdf = 0;                // Everywhere on the sphere.
  double error = 0;              // Of distances, by rounding.
  bool visible = false;
  bool inside = false;
};
// from_inside: which side counts where p is on the surface to within rounding.
SphereView ViewSphere(Vec3d center, double radius, bool from_inside, Vec3f p);
// From outside uniform in the cone, from inside uniform over all directions. n points outward.
// Requires: view.visible.
ShapePoint SampleSphere(const SphereView& view, Vec3d center, double radius, Vec2f u);

// --- Disks -------------------------------------------------------------------------------------

// Nearer than this many radii (to the centre) disks are sampled about the receiver's foot point.
inline constexpr double kDiskPolarDistance = 4;

struct DiskShapeView {
  Vec3d normal, axis_x, axis_y;  // Orthonormal; axis_x points from the foot point to the centre.
  Vec3d foot;                    // The receiver projected onto the disk's plane.
  double radius = 0, inner_radius = 0;
  double height = 0;   // Of the receiver over the plane; positive on the front side.
  double offset = 0;   // Distance from the foot point to the centre.
  double phi_max = 0;  // Half the angle the disk spans about the foot point.
  bool visible = false;
  bool by_area = false;
  bool front() const { return height > 0; }
};
// normal and axis_x: unit, orthogonal.
DiskShapeView ViewDisk(Vec3d center, Vec3d normal, Vec3d axis_x, double radius, double inner_radius,
                       Vec3f p);
// Far away uniform in area; near by uniform in the angle about the foot point and, along the chord
// at that angle, in solid angle: bounded weights however close the receiver is. *hit is false where
// the point falls into the hole. Requires: view.visible.
ShapePoint SampleDisk(const DiskShapeView& view, Vec3f p, Vec2f u, bool* hit);
// wi: unit, from p to p_light, a point of the disk. 0 where not visible.
double PdfDisk(const DiskShapeView& view, Vec3f p, Vec3f wi, Vec3f p_light);

}  // namespace sheaf::render
