// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Intersection of bilinear patches in double, and conversion of flat ones to triangles.
#include "worker/render/geometry/bilinear_patch.h"

#include <algorithm>
#include <cmath>

#include "common/math/next_float.h"

namespace sheaf::render {
namespace {

// Rounding of a triple product in double, relative to the product of the sums of magnitudes of its
// vectors.
constexpr double kProductRounding = 0x1p-48;
// Maximum distance of a hit from an edge relative to the patch's size, and maximum excess of u over
// its range, however ill-conditioned u or v is. The excess of v is at most its range.
constexpr double kSlackMax = 0x1p-16;
constexpr double kParameterSlackMax = 0x1p-6;
// Maximum deviation of a corner from a parallelogram: relative to the largest coordinate, for files
// with float and with six-digit coordinates, and relative to the longest side.
constexpr double kFloatTolerance = 0x1p-22;
constexpr double kSixDigitsTolerance = 1e-5;
constexpr double kSideTolerance = 0x1p-7;

double SumOfMagnitudes(Vec3d v) { return std::fabs(v.x) + std::fabs(v.y) + std::fabs(v.z); }

// The patch as seen by a ray from the origin along d: its line at u runs from start + u along (at v
// = 0) by ruling + u turn.
struct Seen {
  Vec3d d, start, along, ruling, turn;

  Seen(const BilinearPatch& patch, Vec3d o, Vec3d direction)
      : d(direction),
        start(patch.p00 - o),
        along(patch.p10 - patch.p00),
        ruling(patch.p01 - patch.p00),
        turn((patch.p11 - patch.p10) - ruling) {}
};

// Upper bounds of rounding errors.
struct Rounding {
  double d, along, product, slack_length;

  explicit Rounding(const Seen& seen)
      : d(SumOfMagnitudes(seen.d)),
        along(SumOfMagnitudes(seen.along) + SumOfMagnitudes(seen.turn)) {
    const double wide = SumOfMagnitudes(seen.ruling) + SumOfMagnitudes(seen.turn);
    product = kProductRounding * d * (SumOfMagnitudes(seen.start) + along) * wide;
    slack_length = kSlackMax * (along + wide);
  }
};

bool IsWithin(double value, double slack) { return value >= -slack && value <= 1 + slack; }

// Intersects the ray with the line at u, if within the patch.
std::optional<PatchHit> IntersectRuling(const Seen& seen, const Rounding& rounding, double u_root,
                                        double u_slack) {
  if (!IsWithin(u_root, u_slack)) return std::nullopt;
  const double u = std::clamp(u_root, 0.0, 1.0);
  const Vec3d point = seen.start + seen.along * u, ruling = seen.ruling + seen.turn * u;
  const Vec3d across = Cross(seen.d, ruling);
  const double square = LengthSquared(across);
  if (!(square > 0)) return std::nullopt;
  // Errors of the point itself, and of the line's position by u.
  const double moved = kProductRounding * SumOfMagnitudes(point) + u_slack * rounding.along;
  const double v_slack = std::min({1.0, rounding.slack_length / SumOfMagnitudes(ruling),
                                   rounding.d * moved / std::sqrt(square)});
  const double v_line = Dot(Cross(point, seen.d), across) / square;
  if (!IsWithin(v_line, v_slack)) return std::nullopt;
  const double v = std::clamp(v_line, 0.0, 1.0);
  return PatchHit{Dot(point + ruling * v, seen.d) / LengthSquared(seen.d), u, v};
}

// Returns the nearer of up to two intersections with lines of equal u.
std::optional<PatchHit> IntersectRulings(const BilinearPatch& patch, const Seen& seen, Vec3d o,
                                         double t_max) {
  // The ray intersects the line at u where d . (point x ruling) is zero; that is quadratic in u.
  const double at_0 = Dot(seen.d, Cross(seen.start, seen.ruling));
  const double at_1 = Dot(seen.d, Cross(patch.p10 - o, patch.p11 - patch.p10));
  const double square = Dot(seen.d, Cross(seen.along, seen.turn));
  const double linear = at_1 - at_0 - square;
  const double discriminant = linear * linear - 4 * square * at_0;
  const double slope = discriminant > 0 ? std::sqrt(discriminant) : 0;
  // The two roots without cancellation. A root that does not exist is not finite or NaN, and so
  // within no range.
  const double sum = -0.5 * (linear + std::copysign(slope, linear));
  const double roots[2] = {sum / square, at_0 / sum};
  if (!IsWithin(roots[0], kParameterSlackMax) && !IsWithin(roots[1], kParameterSlackMax))
    return std::nullopt;
  const Rounding rounding(seen);
  const double largest = std::fabs(at_0) + std::fabs(linear) + std::fabs(square);
  if (!(largest > 3 * rounding.product)) return std::nullopt;  // The ray lies in the patch's plane.
  if (discriminant < -4 * rounding.product * largest) return std::nullopt;
  const double u_slack = std::min(
      {kParameterSlackMax, rounding.slack_length / rounding.along, 2 * rounding.product / slope});
  std::optional<PatchHit> nearest;
  for (const double u : roots) {
    const std::optional<PatchHit> hit = IntersectRuling(seen, rounding, u, u_slack);
    if (!hit.has_value() || !(hit->t > 0 && hit->t < t_max)) continue;
    if (!nearest.has_value() || hit->t < nearest->t) nearest = hit;
  }
  return nearest;
}

// If an edge is collapsed to a point (the patch is a triangle), a ray to that point must hit, but
// intersects all lines at once, or one without direction.
std::optional<PatchHit> IntersectCollapsedEdge(const BilinearPatch& patch, const Seen& seen,
                                               Vec3d o, double t_max) {
  PatchHit hit;
  if (patch.p00 == patch.p10) {
    hit = {0, 0.5, 0};
  } else if (patch.p01 == patch.p11) {
    hit = {0, 0.5, 1};
  } else if (patch.p00 == patch.p01) {
    hit = {0, 0, 0.5};
  } else if (patch.p10 == patch.p11) {
    hit = {0, 1, 0.5};
  } else {
    return std::nullopt;
  }
  const Vec3d point = patch.PointAt(hit.u, hit.v) - o;
  const double rounding = 4 * kProductRounding * SumOfMagnitudes(point) * SumOfMagnitudes(seen.d);
  if (SumOfMagnitudes(Cross(point, seen.d)) > rounding) return std::nullopt;
  hit.t = Dot(point, seen.d) / LengthSquared(seen.d);
  if (!(hit.t > 0 && hit.t < t_max)) return std::nullopt;
  return hit;
}

}  // namespace

Vec3d BilinearPatch::NormalAt(double u, double v) const {
  // The factors are linear, so the mean over the corners equals the value at the middle.
  for (const auto& [at_u, at_v] :
       {std::array{u, v}, std::array{0.5, 0.5}, std::array{0.0, 0.0}, std::array{1.0, 0.0},
        std::array{0.0, 1.0}, std::array{1.0, 1.0}}) {
    const Vec3d n = Cross(DpduAt(at_v), DpdvAt(at_u));
    if (LengthSquared(n) > 0) return n;
  }
  return {};
}

bool BilinearPatch::IsFlat() const {
  const Vec3d a = p10 - p00, b = p01 - p00, c = p11 - p00;
  const double rounding =
      kProductRounding * SumOfMagnitudes(a) * SumOfMagnitudes(b) * SumOfMagnitudes(c);
  return std::fabs(Dot(Cross(a, b), c)) <= rounding;
}

std::optional<PatchHit> IntersectPatch(const BilinearPatch& patch, Vec3d o, Vec3d d, double t_max) {
  const Seen seen(patch, o, d);
  const std::optional<PatchHit> hit = IntersectRulings(patch, seen, o, t_max);
  return hit.has_value() ? hit : IntersectCollapsedEdge(patch, seen, o, t_max);
}

std::array<Vec3f, 2> PatchBounds(const BilinearPatch& patch) {
  std::array<Vec3f, 2> bounds;
  for (size_t i = 0; i < 3; ++i) {
    const auto [lower, upper] =
        std::minmax({patch.p00[i], patch.p10[i], patch.p01[i], patch.p11[i]});
    bounds[0][i] = NextDown(static_cast<float>(lower));
    bounds[1][i] = NextUp(static_cast<float>(upper));
  }
  return bounds;
}

namespace {

bool IsParallelogram(const std::array<Vec3d, 4>& p, double coordinate_tolerance) {
  const Vec3d off = (p[3] - p[1]) - (p[2] - p[0]);
  const double side_max = std::max(Length(p[1] - p[0]), Length(p[2] - p[0]));
  if (Length(off) > kSideTolerance * side_max) return false;
  for (size_t i = 0; i < 3; ++i) {
    double largest = 0;
    for (const Vec3d& corner : p) largest = std::max(largest, std::fabs(corner[i]));
    if (std::fabs(off[i]) > coordinate_tolerance * largest) return false;
  }
  return true;
}

}  // namespace

bool IsTriangles(const BilinearMesh& mesh, bool is_light) {
  for (size_t i = 0; i + 3 < mesh.indices.size(); i += 4) {
    const uint32_t* k = &mesh.indices[i];
    std::array<Vec3d, 4> corners, uvs;
    for (size_t c = 0; c < 4; ++c) {
      corners[c] = ToDouble(mesh.positions[k[c]]);
      if (!mesh.uvs.empty()) uvs[c] = {mesh.uvs[k[c]].x, mesh.uvs[k[c]].y, 0};
      if (!mesh.normals.empty() && !(mesh.normals[k[c]] == mesh.normals[k[0]])) return false;
    }
    if (!IsParallelogram(corners, is_light ? kSixDigitsTolerance : kFloatTolerance)) return false;
    if (!mesh.uvs.empty() && !IsParallelogram(uvs, kFloatTolerance)) return false;
  }
  return true;
}

TriangleMesh ToTriangles(const BilinearMesh& mesh) {
  static constexpr Vec2f kUvs[4] = {{0, 0}, {1, 0}, {0, 1}, {1, 1}};
  TriangleMesh triangles;
  for (size_t i = 0; i + 3 < mesh.indices.size(); i += 4) {
    const auto first = static_cast<uint32_t>(triangles.positions.size());
    for (size_t c = 0; c < 4; ++c) {
      const uint32_t k = mesh.indices[i + c];
      triangles.positions.push_back(mesh.positions[k]);
      triangles.uvs.push_back(mesh.uvs.empty() ? kUvs[c] : mesh.uvs[k]);
      if (!mesh.normals.empty()) triangles.normals.push_back(mesh.normals[k]);
    }
    for (const uint32_t corner : {0u, 1u, 3u, 0u, 3u, 2u}) {
      triangles.indices.push_back(first + corner);
    }
  }
  return triangles;
}

}  // namespace sheaf::render
