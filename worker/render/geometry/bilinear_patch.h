// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Bilinear patches: the surface through four corners whose lines of equal u, and of equal v, are
// straight. A ray intersects up to two of the lines of equal u, by a quadratic, which is solved in
// double. Source: Reshetov 2019, "Cool Patches: A Geometric Approach to Ray/Bilinear Patch
// Intersections", Ray Tracing Gems ch. 8; parametrization after pbrt-v4, ch. 6.6.
#pragma once

#include <array>
#include <optional>

#include "common/math/vec.h"
#include "common/scene/scene_description.h"

namespace sheaf::render {

// p10 is the corner at u = 1, v = 0.
struct BilinearPatch {
  Vec3d p00, p10, p01, p11;

  // u and v in [0, 1].
  Vec3d PointAt(double u, double v) const {
    return (p00 * (1 - u) + p10 * u) * (1 - v) + (p01 * (1 - u) + p11 * u) * v;
  }
  Vec3d DpduAt(double v) const { return (p10 - p00) * (1 - v) + (p11 - p01) * v; }
  Vec3d DpdvAt(double u) const { return (p01 - p00) * (1 - u) + (p11 - p10) * u; }
  // Along Cross(dpdu, dpdv), not unit; where that is zero (at a corner where two edges coincide),
  // the normal at the middle or at another corner. Zero only for patches without area.
  Vec3d NormalAt(double u, double v) const;
  // Whether all four corners are coplanar, to rounding.
  bool IsFlat() const;
};

struct PatchHit {
  double t = 0;  // In lengths of d: of the ray's point closest to that at u and v.
  double u = 0, v = 0;
};

// Returns the nearest intersection of o + t d with the patch, 0 < t < t_max. Rays that pass an edge
// within rounding hit it, so that patches with shared corners leave no gap. Rays in the plane of a
// flat patch miss it.
std::optional<PatchHit> IntersectPatch(const BilinearPatch& patch, Vec3d o, Vec3d d, double t_max);

// Axis-aligned bounds, rounded outwards to float: lower, upper.
std::array<Vec3f, 2> PatchBounds(const BilinearPatch& patch);

// Whether two triangles per patch are equivalent to the mesh: all patches are parallelograms to the
// rounding of the file (six digits where the shape is a light, which must be flat; else that of
// float), uvs are linear over them and normals are constant.
bool IsTriangles(const BilinearMesh& mesh, bool is_light);
// Requires: IsTriangles.
TriangleMesh ToTriangles(const BilinearMesh& mesh);

}  // namespace sheaf::render
