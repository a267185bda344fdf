// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// How the shading normal turns along a surface of the world: on triangles by their vertex normals,
// on quadrics by the gradient of their equation.
#pragma once

#include <cstdint>

#include "common/math/vec.h"
#include "worker/render/geometry/raw_hit.h"
#include "worker/render/geometry/scene_geometry.h"

namespace sheaf::render {

namespace internal {

// The change of the direction of v where v changes by dv.
inline Vec3d TurnOf(Vec3d v, Vec3d dv) {
  const double scale = 1 / Length(v);
  const Vec3d n = v * scale;
  return (dv - n * Dot(n, dv)) * scale;
}

inline Vec3d TriangleNormalDerivative(const BakedMesh& mesh, const RawHit& hit, Vec3d dp) {
  if (mesh.normals.empty()) return {};
  const uint32_t* t = &mesh.indices[3 * static_cast<size_t>(hit.id.primitive)];
  const Vec3d p0 = ToDouble(mesh.positions[t[0]]);
  const Vec3d e1 = ToDouble(mesh.positions[t[1]]) - p0, e2 = ToDouble(mesh.positions[t[2]]) - p0;
  const Vec3d n0 = ToDouble(mesh.normals[t[0]]), n1 = ToDouble(mesh.normals[t[1]]),
              n2 = ToDouble(mesh.normals[t[2]]);
  const double u = static_cast<double>(hit.u), v = static_cast<double>(hit.v);
  // The barycentric weights change by du and dv.
  const Vec3d cross = Cross(e1, e2);
  const double scale = 1 / LengthSquared(cross);
  const double du = Dot(Cross(dp, e2), cross) * scale, dv = Dot(Cross(e1, dp), cross) * scale;
  const Vec3d change = (n1 - n0) * du + (n2 - n0) * dv;
  return TurnOf(n0 * (1 - u - v) + n1 * u + n2 * v, change);
}

inline Vec3d QuadricNormalDerivative(const Quadric& quadric, Vec3d p, Vec3d dp) {
  if (quadric.kind == Quadric::Kind::kDisk) return {};
  // Half the gradient in object space.
  Vec3d gradient = quadric.object_from_target.Point(p);
  Vec3d change = quadric.object_from_target.Vector(dp);
  if (quadric.kind == Quadric::Kind::kCylinder) gradient.z = change.z = 0;
  return TurnOf(quadric.object_from_target.TransposedVector(gradient),
                quadric.object_from_target.TransposedVector(change));
}

}  // namespace internal

// The change of the unit shading normal n at the point p of the hit, where p moves by dp along the
// surface. Space: render. Requires: the hit is one of the world, on a triangle or a quadric, and n
// is the normal that vertex normals give there unchanged (or its opposite).
inline Vec3d NormalDerivative(const GeometryGroup& world, const RawHit& hit, Vec3d p, Vec3d n,
                              Vec3d dp) {
  if (hit.id.geometry < world.meshes.size()) {
    const BakedMesh& mesh = world.meshes[hit.id.geometry];
    if (mesh.normals.empty()) return {};
    const uint32_t* t = &mesh.indices[3 * static_cast<size_t>(hit.id.primitive)];
    const Vec3f sum = mesh.normals[t[0]] + mesh.normals[t[1]] + mesh.normals[t[2]];
    const Vec3d turn = internal::TriangleNormalDerivative(mesh, hit, dp);
    return Dot(ToDouble(sum), n) < 0 ? -turn : turn;
  }
  const Quadric& quadric = world.quadrics[hit.id.primitive].quadric;
  const Vec3d turn = internal::QuadricNormalDerivative(quadric, p, dp);
  Vec3d outward = quadric.object_from_target.Point(p);
  if (quadric.kind == Quadric::Kind::kCylinder) outward.z = 0;
  return Dot(quadric.object_from_target.TransposedVector(outward), n) < 0 ? -turn : turn;
}

}  // namespace sheaf::render
