// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GroupPoint: the point of a hit in double, in the space of its group, from the description of each
// kind of shape. surface_point.h makes the point for shading of it.
#pragma once

#include <algorithm>
#include <cmath>

#include "common/math/vec.h"
#include "worker/render/geometry/deforming_mesh.h"
#include "worker/render/geometry/raw_hit.h"
#include "worker/render/geometry/scene_geometry.h"

namespace sheaf::render {
namespace internal {

inline constexpr double kDoubleRounding = 0x1p-50;  // A few roundings of double.

// A point before it is rounded to float and placed. Space: that of the group.
struct GroupPoint {
  Vec3d p, ng, ns;
  Vec3f coordinate_max;  // Bound of the coordinates from which the point was computed.
  Vec2f uv;
  Vec3d dpdu, dpdv;
  bool has_tangents = false;
  Vec3d own_tangent;  // As TangentPlane's.
  double reach = 0;   // For curves: SurfacePoint::reach.
  VertexColor color{1, 1, 1, 1};
};

// Minimum cosine between interpolated vertex normals and the geometric normal for unmodified use.
inline constexpr double kShadingCosineMin = 0.5;

// Returns the shading normal for interpolated vertex normals ns on a surface with unit normal ng.
// Beyond 60 degrees it is pulled towards ng, which it reaches at 90: such a normal carries no
// information about the lighting. See docs/adr/0052.
inline Vec3d ShadingNormalOf(Vec3d ns, Vec3d ng) {
  const double height = Dot(ns, ng);
  if (!(height > 0)) return ng;
  const double least_squared = kShadingCosineMin * kShadingCosineMin * LengthSquared(ns);
  if (height * height >= least_squared) return ns;
  const double fraction = height / std::sqrt(least_squared);
  return ns * (fraction * kShadingCosineMin / std::sqrt(least_squared)) + ng * (1 - fraction);
}

inline Vec3f MaxAbs(Vec3f a, Vec3f b, Vec3f c) {
  Vec3f result;
  for (size_t i = 0; i < 3; ++i) {
    result[i] = std::max(std::fabs(a[i]), std::max(std::fabs(b[i]), std::fabs(c[i])));
  }
  return result;
}

// Sets uv and its tangents on a triangle. Without uvs the corners are (0,0), (1,0), (1,1), as in
// pbrt-v4.
inline void AddTriangleParameters(const BakedMesh& mesh, const uint32_t* t, const RawHit& hit,
                                  Vec3d e1, Vec3d e2, GroupPoint* point) {
  Vec2f uv0{0, 0}, uv1{1, 0}, uv2{1, 1};
  if (!mesh.uvs.empty()) {
    uv0 = mesh.uvs[t[0]];
    uv1 = mesh.uvs[t[1]];
    uv2 = mesh.uvs[t[2]];
  }
  point->uv = uv0 + hit.u * (uv1 - uv0) + hit.v * (uv2 - uv0);
  if (!mesh.colors.empty()) [[unlikely]] {
    for (size_t i = 0; i < point->color.size(); ++i) {
      point->color[i] = mesh.colors[t[0]][i] * (1 - hit.u - hit.v) + mesh.colors[t[1]][i] * hit.u +
                        mesh.colors[t[2]][i] * hit.v;
    }
  }
  if (!mesh.surface.needs_tangent) return;
  if (!mesh.tangents.empty()) [[unlikely]] {
    point->own_tangent = ToDouble(mesh.tangents[t[0]] * (1 - hit.u - hit.v) +
                                  mesh.tangents[t[1]] * hit.u + mesh.tangents[t[2]] * hit.v);
  }
  const double u1 = static_cast<double>(uv1.x) - uv0.x, v1 = static_cast<double>(uv1.y) - uv0.y;
  const double u2 = static_cast<double>(uv2.x) - uv0.x, v2 = static_cast<double>(uv2.y) - uv0.y;
  const double determinant = u1 * v2 - u2 * v1;
  if (determinant == 0) return;
  point->dpdu = (e1 * v2 - e2 * v1) * (1 / determinant);
  point->dpdv = (e2 * u1 - e1 * u2) * (1 / determinant);
  point->has_tangents = true;
}

inline GroupPoint TrianglePoint(const BakedMesh& mesh, const RawHit& hit, bool wants_parameters) {
  const uint32_t* t = &mesh.indices[3 * static_cast<size_t>(hit.id.primitive)];
  const Vec3f &f0 = mesh.positions[t[0]], &f1 = mesh.positions[t[1]], &f2 = mesh.positions[t[2]];
  const Vec3d p0 = ToDouble(f0), e1 = ToDouble(f1) - p0, e2 = ToDouble(f2) - p0;
  GroupPoint point;
  point.p = p0 + e1 * static_cast<double>(hit.u) + e2 * static_cast<double>(hit.v);
  point.coordinate_max = MaxAbs(f0, f1, f2);
  const Vec3d cross = Cross(e1, e2);
  // No degenerate triangles remain: the length is positive, and no product of floats underflows.
  point.ng = cross * (static_cast<double>(TriangleFacing(mesh, t, cross)) / Length(cross));
  point.ns = point.ng;
  if (!mesh.normals.empty()) {
    const Vec3f ns = mesh.normals[t[0]] * (1 - hit.u - hit.v) + mesh.normals[t[1]] * hit.u +
                     mesh.normals[t[2]] * hit.v;
    point.ns = ShadingNormalOf(ToDouble(ns), point.ng);
  }
  if (wants_parameters) AddTriangleParameters(mesh, t, hit, e1, e2, &point);
  return point;
}

inline GroupPoint DeformedTrianglePoint(const BakedMesh& mesh, const RawHit& hit,
                                        float shutter_fraction, bool wants_parameters) {
  const uint32_t* t = &mesh.indices[3 * static_cast<size_t>(hit.id.primitive)];
  const VertexTime time = VertexTimeAt(mesh, shutter_fraction);
  const DeformedTriangle triangle = DeformedTriangleAt(mesh, t, time);
  const Vec3d p0 = triangle.corners[0], e1 = triangle.corners[1] - p0,
              e2 = triangle.corners[2] - p0;
  GroupPoint point;
  point.p = p0 + e1 * static_cast<double>(hit.u) + e2 * static_cast<double>(hit.v);
  point.coordinate_max = triangle.coordinate_max;
  // Positive, because the tracer's filter rejects hits while the triangle has no area.
  const Vec3d cross = Cross(e1, e2);
  point.ng = cross * (1 / Length(cross));
  if (mesh.normals.empty()) {
    if (mesh.surface.flips_normal) point.ng = -point.ng;
    point.ns = point.ng;
  } else {
    const Vec3f n0 = DeformedNormalAt(mesh, t[0], time), n1 = DeformedNormalAt(mesh, t[1], time),
                n2 = DeformedNormalAt(mesh, t[2], time);
    const double facing = FacingOf(mesh.surface, cross, n0 + n1 + n2);
    point.ng = point.ng * facing;
    const Vec3d ns = ToDouble(n0 * (1 - hit.u - hit.v) + n1 * hit.u + n2 * hit.v);
    point.ns = ShadingNormalOf(ns, point.ng);
  }
  if (wants_parameters) AddTriangleParameters(mesh, t, hit, e1, e2, &point);
  return point;
}

inline GroupPoint PointOnQuadric(const BakedQuadric& baked, Vec3d o, Vec3d d, double t,
                                 bool wants_parameters) {
  const QuadricPoint on = QuadricPointAt(baked.quadric, o, d, t);
  GroupPoint point;
  point.p = on.p;
  point.ng = baked.surface.flips_normal ? -on.n : on.n;
  point.ns = point.ng;
  point.coordinate_max = baked.quadric.coordinate_max;
  if (wants_parameters) {
    const QuadricParameters parameters = QuadricParametersAt(baked.quadric, on.p_object);
    point.uv = parameters.uv;
    point.dpdu = parameters.dpdu;
    point.dpdv = parameters.dpdv;
    point.has_tangents = true;
  }
  return point;
}

// The vertex normals at a patch's corners, as a bilinear patch.
inline BilinearPatch PatchNormals(const BakedPatches& baked, const uint32_t* k) {
  return {ToDouble(baked.normals[k[0]]), ToDouble(baked.normals[k[1]]),
          ToDouble(baked.normals[k[2]]), ToDouble(baked.normals[k[3]])};
}
inline BilinearPatch PatchUvs(const BakedPatches& baked, const uint32_t* k) {
  const auto at = [&](size_t c) { return Vec3d{baked.uvs[k[c]].x, baked.uvs[k[c]].y, 0}; };
  return {at(0), at(1), at(2), at(3)};
}

inline void AddPatchParameters(const BakedPatches& baked, const uint32_t* k,
                               const BilinearPatch& patch, double u, double v, GroupPoint* point) {
  const Vec3d dpdu = patch.DpduAt(v), dpdv = patch.DpdvAt(u);
  if (baked.uvs.empty()) {
    point->uv = {static_cast<float>(u), static_cast<float>(v)};
    point->dpdu = dpdu;
    point->dpdv = dpdv;
    point->has_tangents = true;
    return;
  }
  const BilinearPatch uvs = PatchUvs(baked, k);
  const Vec3d uv = uvs.PointAt(u, v), by_u = uvs.DpduAt(v), by_v = uvs.DpdvAt(u);
  point->uv = {static_cast<float>(uv.x), static_cast<float>(uv.y)};
  const double determinant = by_u.x * by_v.y - by_v.x * by_u.y;
  if (determinant == 0) return;
  point->dpdu = (dpdu * by_v.y - dpdv * by_u.y) * (1 / determinant);
  point->dpdv = (dpdv * by_u.x - dpdu * by_v.x) * (1 / determinant);
  point->has_tangents = true;
}

inline GroupPoint PointOnPatch(const BakedPatches& baked, const RawHit& hit,
                               bool wants_parameters) {
  const BilinearPatch patch = baked.PatchAt(hit.id.primitive);
  const uint32_t* k = &baked.indices[4 * static_cast<size_t>(hit.id.primitive)];
  const double u = static_cast<double>(hit.u), v = static_cast<double>(hit.v);
  GroupPoint point;
  point.p = patch.PointAt(u, v);
  for (size_t i = 0; i < 3; ++i) {
    point.coordinate_max[i] = std::max(
        std::max(std::fabs(baked.positions[k[0]][i]), std::fabs(baked.positions[k[1]][i])),
        std::max(std::fabs(baked.positions[k[2]][i]), std::fabs(baked.positions[k[3]][i])));
  }
  const Vec3d n = Normalize(patch.NormalAt(u, v));
  point.ng = baked.surface.flips_normal ? -n : n;
  point.ns = point.ng;
  if (!baked.normals.empty()) {
    const Vec3d ns = PatchNormals(baked, k).PointAt(u, v);
    // Vertex normals decide which side is the front (as in pbrt-v4).
    if (Dot(ns, point.ng) < 0) point.ng = -point.ng;
    point.ns = ShadingNormalOf(ns, point.ng);
  }
  if (wants_parameters) AddPatchParameters(baked, k, patch, u, v, &point);
  return point;
}

inline GroupPoint PointOnCurve(const BakedCurves& baked, Vec3d d, const RawHit& hit) {
  const size_t segment = baked.pieces[hit.id.primitive].segment;
  const CurvePoint on = CurvePointAt(SegmentOf(baked.set, segment), static_cast<double>(hit.u),
                                     static_cast<double>(hit.v), baked.shape_from_target.Vector(d));
  GroupPoint point;
  point.p = baked.target_from_shape.Point(on.p);
  const Vec3d n = baked.shape_from_target.TransposedVector(on.n);
  const double scale = 1 / Length(n);
  point.ng = n * (baked.surface.flips_normal ? -scale : scale);
  point.ns = point.ng;
  point.coordinate_max = baked.coordinate_max;
  point.uv = {hit.u, hit.v};
  point.dpdu = baked.target_from_shape.Vector(on.dpdu);
  point.has_tangents = true;
  // A ray is beyond every ribbon about the center line after one width.
  point.reach = on.width * scale;
  return point;
}

// The transforms of a placed group at the ray's time.
struct Placement {
  Affine render_from_group, group_from_render;
};

// Transforms the point from its group to render space. The next ray is rounded to float in the
// group's space again, so the bound includes that rounding, transformed to render space.
inline void PlacePoint(const Placement& placement, GroupPoint* point, Vec3d* rounding) {
  const auto& [render_from_group, group_from_render] = placement;
  const Vec3f g = point->coordinate_max;
  const double unit = static_cast<double>(Gamma(2));
  for (size_t i = 0; i < 3; ++i) {
    (*rounding)[i] =
        unit * (std::fabs(render_from_group.x[i] * point->p.x) +
                std::fabs(render_from_group.y[i] * point->p.y) +
                std::fabs(render_from_group.z[i] * point->p.z)) +
        kDoubleRounding *
            (std::fabs(render_from_group.x[i]) * g.x + std::fabs(render_from_group.y[i]) * g.y +
             std::fabs(render_from_group.z[i]) * g.z + std::fabs(render_from_group.offset[i]));
  }
  point->p = render_from_group.Point(point->p);
  const bool is_flat = point->ns == point->ng;
  point->ng = Normalize(group_from_render.TransposedVector(point->ng));
  point->ns = is_flat ? point->ng : group_from_render.TransposedVector(point->ns);
  point->dpdu = render_from_group.Vector(point->dpdu);
  point->dpdv = render_from_group.Vector(point->dpdv);
  point->own_tangent = render_from_group.Vector(point->own_tangent);
}

}  // namespace internal
}  // namespace sheaf::render
