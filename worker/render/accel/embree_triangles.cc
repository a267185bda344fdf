// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Filters of triangle hits for Embree. For single rays, its N-wide records have the layout of the
// single ones.
#include <array>
#include <cmath>
#include <optional>

#include "worker/render/accel/embree_callbacks.h"
#include "worker/render/geometry/deforming_mesh.h"
#include "worker/render/geometry/needle.h"

namespace sheaf::render {
namespace {

// Weights of corners below which a hit is near the opposite edge.
constexpr float kEdgeWeight = 0x1p-18f;

// A hit that Embree found and a filter checks. While filters run, the ray ends at the hit.
struct Candidate {
  const TraceContext& context;
  const TracedMesh& traced;
  const BakedMesh& mesh;
  RTCRay& ray;
  RTCHit& hit;

  explicit Candidate(const RTCFilterFunctionNArguments* args)
      : context(ContextOf(args->context)),
        traced(*static_cast<const TracedMesh*>(args->geometryUserPtr)),
        mesh(*traced.mesh),
        ray(*reinterpret_cast<RTCRay*>(args->ray)),
        hit(*reinterpret_cast<RTCHit*>(args->hit)) {}

  // The triangle that the ray leaves, or the emitter on which it ends, which a line meets once; or
  // one that the ray passes by.
  bool IsSkipped() const {
    return context.IsSource(hit.geomID, hit.primID) || context.IsEnd(mesh.surface, hit.primID) ||
           context.IsPassedBy(hit.geomID, hit.primID);
  }
  // So near to an edge that the ray may pass beside it: Embree widens triangles by 2^-23.
  bool IsNearEdge() const {
    return hit.u <= kEdgeWeight || hit.v <= kEdgeWeight || hit.u + hit.v >= 1 - kEdgeWeight;
  }
  const uint32_t* Indices() const { return &mesh.indices[3 * static_cast<size_t>(hit.primID)]; }
  float AlongNormal() const { return TimesNormal(ray.dir_x, ray.dir_y, ray.dir_z); }
  // The distance to the triangle's plane, as Embree has it before its division.
  float PlaneDistance(float along) const {
    const Vec3f corner = mesh.positions[Indices()[0]];
    return TimesNormal(corner.x - ray.org_x, corner.y - ray.org_y, corner.z - ray.org_z) / along;
  }
  float TimesNormal(float x, float y, float z) const {
    return std::fma(x, hit.Ng_x, std::fma(y, hit.Ng_y, z * hit.Ng_z));
  }
  // Bound of the error of PlaneDistance, and of the triangle's own coordinates.
  float Doubt(float along) const {
    const Vec3f& reach = traced.reach;
    const float sum = std::fabs(hit.Ng_x) * (reach.x + std::fabs(ray.org_x)) +
                      std::fabs(hit.Ng_y) * (reach.y + std::fabs(ray.org_y)) +
                      std::fabs(hit.Ng_z) * (reach.z + std::fabs(ray.org_z));
    return kPlaneRounding * sum / std::fabs(along);
  }
  TracerHit HitAt(float t) const { return {t, 0, 0, context.IdOf(hit.geomID, hit.primID)}; }
  bool Take(float t, float doubt) const {
    if (!context.Take(HitAt(t), doubt)) return false;
    ray.tfar = context.SearchEndOf();
    return true;
  }
};

// For a mesh without needles Embree decides which hits exist; we compute their distance.
void JudgeNearest(const RTCFilterFunctionNArguments* args) {
  const Candidate candidate(args);
  args->valid[0] = 0;
  if (candidate.IsSkipped()) return;
  const float along = candidate.AlongNormal();
  if (!candidate.Take(candidate.PlaneDistance(along), candidate.Doubt(along))) return;
  args->valid[0] = -1;
  candidate.context.unsettled = &candidate.mesh;
  candidate.context.passes_beside = candidate.IsNearEdge();
}
void JudgeAny(const RTCFilterFunctionNArguments* args) {
  const Candidate candidate(args);
  const float along = candidate.AlongNormal();
  const bool is_in_the_way =
      !candidate.IsSkipped() &&
      candidate.context.Blocks(candidate.HitAt(candidate.PlaneDistance(along)),
                               candidate.Doubt(along));
  if (is_in_the_way && candidate.context.EndsAtPassable(candidate.mesh.surface)) return;
  if (is_in_the_way && !candidate.IsNearEdge()) return;
  args->valid[0] = 0;
  candidate.context.is_undecided |= is_in_the_way;
}
// Recomputes a hit in double, or rejects it. The result may be farther than Embree's, up to the
// last accepted hit. find_hit: intersects the ray with a triangle of the mesh (three indices).
// kAny: for rays that ask only whether something is hit.
template <bool kAny, typename FindHit>
void TestAgain(const RTCFilterFunctionNArguments* args, const FindHit& find_hit) {
  const Candidate candidate(args);
  args->valid[0] = 0;
  if (candidate.IsSkipped()) return;
  const std::optional<TriangleHit> found =
      find_hit(candidate.mesh, candidate.Indices(), candidate.ray);
  const float t = found.has_value() ? static_cast<float>(found->t) : 0;
  if (!(t > 0)) return;
  const float doubt = candidate.Doubt(candidate.AlongNormal());
  if (kAny ? !candidate.context.Blocks(candidate.HitAt(t), doubt) : !candidate.Take(t, doubt))
    return;
  if (kAny && candidate.context.EndsAtPassable(candidate.mesh.surface)) {
    args->valid[0] = -1;
    return;
  }
  (kAny ? candidate.context.is_undecided : candidate.context.passes_beside) |= !found->is_inside;
  if (kAny && !found->is_inside) return;
  args->valid[0] = -1;
  candidate.hit.u = static_cast<float>(found->u);
  candidate.hit.v = static_cast<float>(found->v);
}
template <bool kAny>
void TestNeedleAgain(const RTCFilterFunctionNArguments* args) {
  TestAgain<kAny>(args, [](const BakedMesh& mesh, const uint32_t* t, const RTCRay& ray) {
    return IntersectTriangle(Origin(ray), Direction(ray),
                             {ToDouble(mesh.positions[t[0]]), ToDouble(mesh.positions[t[1]]),
                              ToDouble(mesh.positions[t[2]])});
  });
}
template <bool kAny>
void TestDeformedAgain(const RTCFilterFunctionNArguments* args) {
  TestAgain<kAny>(args,
                  [](const BakedMesh& mesh, const uint32_t* t,
                     const RTCRay& ray) -> std::optional<TriangleHit> {
                    const DeformedTriangle triangle =
                        DeformedTriangleAt(mesh, t, VertexTimeAt(mesh, ray.time));
                    const auto& [a, b, c] = triangle.corners;
                    // At this time the triangle may be degenerate.
                    if (!(LengthSquared(Cross(b - a, c - a)) > 0)) return std::nullopt;
                    return IntersectTriangle(Origin(ray), Direction(ray), triangle.corners,
                                             CornerErrorOf(mesh, triangle));
                  });
}

}  // namespace

void Settle(const TraceContext& context, RTCRayHit* ray_hit) {
  if (context.unsettled == nullptr) return;
  const BakedMesh& mesh = *context.unsettled;
  const uint32_t* t = &mesh.indices[3 * static_cast<size_t>(ray_hit->hit.primID)];
  const CornerWeights corners =
      CornerWeightsOf(Origin(ray_hit->ray), Direction(ray_hit->ray),
                      {ToDouble(mesh.positions[t[0]]), ToDouble(mesh.positions[t[1]]),
                       ToDouble(mesh.positions[t[2]])});
  ray_hit->hit.u = static_cast<float>(corners.weights[1]);
  ray_hit->hit.v = static_cast<float>(corners.weights[2]);
  context.passes_beside &= !corners.is_inside;
}

void FilterTriangles(RTCGeometry triangles, TracedMesh* mesh, bool has_needles) {
  rtcSetGeometryUserData(triangles, mesh);
  rtcSetGeometryIntersectFilterFunction(triangles,
                                        has_needles ? TestNeedleAgain<false> : JudgeNearest);
  rtcSetGeometryOccludedFilterFunction(triangles, has_needles ? TestNeedleAgain<true> : JudgeAny);
}

void FilterDeforming(RTCGeometry triangles, TracedMesh* mesh) {
  rtcSetGeometryUserData(triangles, mesh);
  rtcSetGeometryIntersectFilterFunction(triangles, TestDeformedAgain<false>);
  rtcSetGeometryOccludedFilterFunction(triangles, TestDeformedAgain<true>);
}

}  // namespace sheaf::render
