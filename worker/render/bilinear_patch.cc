// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Bilinear patches met in double, and those that are triangles.
#include "worker/render/bilinear_patch.h"

#include <algorithm>
#include <cmath>

#include "common/math/next_float.h"

namespace sheaf::render {
namespace {

// Rounding of a triple product in double, in parts of the product of its vectors' sums of
// magnitudes.
constexpr double kProductRounding = 0x1p-48;
// However badly u or v is determined, a hit is no farther from the edge of its range than this.
constexpr double kParameterSlackMax = 0x1p-16;
// How far a corner may be from where the other three would have it in a parallelogram: in parts of
// the largest coordinate, for files written in float and with six digits, and of the longest side.
constexpr double kFloatTolerance = 0x1p-22;
constexpr double kSixDigitsTolerance = 1e-5;
constexpr double kSideTolerance = 0x1p-7;

double SumOfMagnitudes(Vec3d v) { return std::fabs(v.x) + std::fabs(v.y) + std::fabs(v.z); }

// The patch as seen by a ray from the origin along d: its line at u goes from
// start + u along (at v = 0) by ruling + u turn.
struct Seen {
  Vec3d d, start, along, ruling, turn;
  double product_rounding;  // Of d . (point x ruling).

  Seen(const BilinearPatch& patch, Vec3d o, Vec3d direction)
      : d(direction),
        start(patch.p00 - o),
        along(patch.p10 - patch.p00),
        ruling(patch.p01 - patch.p00),
        turn((patch.p11 - patch.p10) - ruling) {
    const double far = SumOfMagnitudes(start) + SumOfMagnitudes(along);
    const double wide = SumOfMagnitudes(ruling) + SumOfMagnitudes(patch.p11 - patch.p10);
    product_rounding = kProductRounding * SumOfMagnitudes(d) * far * wide;
  }
};

double WithSlack(double value, double slack, bool* is_within) {
  *is_within = value >= -slack && value <= 1 + slack;
  return std::clamp(value, 0.0, 1.0);
}

// Where on the line at u the ray passes, if within the patch.
std::optional<PatchHit> MeetRuling(const Seen& seen, double u_root, double u_slack) {
  bool is_within = false;
  const double u = WithSlack(u_root, u_slack, &is_within);
  if (!is_within) return std::nullopt;
  const Vec3d point = seen.start + seen.along * u, ruling = seen.ruling + seen.turn * u;
  const Vec3d across = Cross(seen.d, ruling);
  const double square = LengthSquared(across);
  if (!(square > 0)) return std::nullopt;
  // Of the point itself, and of where u has the line.
  const double rounding = SumOfMagnitudes(seen.d) *
                          (kProductRounding * SumOfMagnitudes(point) +
                           u_slack * (SumOfMagnitudes(seen.along) + SumOfMagnitudes(seen.turn)));
  const double v =
      WithSlack(Dot(Cross(point, seen.d), across) / square,
                std::min(kParameterSlackMax, rounding / std::sqrt(square)), &is_within);
  if (!is_within) return std::nullopt;
  return PatchHit{Dot(point + ruling * v, seen.d) / LengthSquared(seen.d), u, v};
}

}  // namespace

Vec3d BilinearPatch::NormalAt(double u, double v) const {
  // A product of two linear functions: its mean over the corners is that of the middle.
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
  // The ray meets the line at u where d . (point x ruling) is zero; that is quadratic in u.
  const double at_0 = Dot(d, Cross(seen.start, seen.ruling));
  const double at_1 = Dot(d, Cross(patch.p10 - o, patch.p11 - patch.p10));
  const double square = Dot(d, Cross(seen.along, seen.turn));
  const double linear = at_1 - at_0 - square;
  const double rounding = seen.product_rounding;
  const double largest = std::fabs(at_0) + std::fabs(linear) + std::fabs(square);
  if (!(largest > 3 * rounding)) return std::nullopt;  // In its plane.
  double discriminant = linear * linear - 4 * square * at_0;
  if (discriminant < -4 * rounding * largest) return std::nullopt;
  const double slope = std::sqrt(std::max(0.0, discriminant));
  const double u_slack =
      slope > 0 ? std::min(kParameterSlackMax, 2 * rounding / slope) : kParameterSlackMax;
  // The two roots without cancellation. Where one does not exist it is not finite, or zero by zero,
  // and so within nothing.
  const double sum = -0.5 * (linear + std::copysign(slope, linear));
  std::optional<PatchHit> nearest;
  for (const double u : {sum / square, at_0 / sum}) {
    const std::optional<PatchHit> hit = MeetRuling(seen, u, u_slack);
    if (!hit.has_value() || !(hit->t > 0 && hit->t < t_max)) continue;
    if (!nearest.has_value() || hit->t < nearest->t) nearest = hit;
  }
  return nearest;
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
