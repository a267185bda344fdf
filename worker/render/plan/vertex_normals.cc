// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Measures the angles between vertex normals and faces.
#include "worker/render/plan/vertex_normals.h"

#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "worker/render/geometry/bilinear_patch.h"

namespace sheaf::render {
namespace {

// Applies the cofactors of the transform's matrix: as normals of faces and of vertices change.
class NormalTransform {
 public:
  explicit NormalTransform(const Affine& t)
      : x_(Cross(t.y, t.z)), y_(Cross(t.z, t.x)), z_(Cross(t.x, t.y)) {}
  Vec3d operator()(Vec3d n) const { return n.x * x_ + n.y * y_ + n.z * z_; }

 private:
  Vec3d x_, y_, z_;
};

bool IsApart(Vec3d face, Vec3d vertex, double cosine_max) {
  const double lengths = std::sqrt(LengthSquared(face) * LengthSquared(vertex));
  return lengths > 0 && std::isfinite(lengths) &&
         std::fabs(Dot(face, vertex)) < cosine_max * lengths;
}

bool IsTilted(const std::vector<Vec3f>& positions, const std::vector<Vec3f>& normals,
              const std::vector<uint32_t>& indices, const NormalTransform& transform,
              double cosine_max) {
  if (normals.empty()) return false;
  for (size_t i = 0; i + 2 < indices.size(); i += 3) {
    const Vec3d p = ToDouble(positions[indices[i]]);
    const Vec3d face = transform(
        Cross(ToDouble(positions[indices[i + 1]]) - p, ToDouble(positions[indices[i + 2]]) - p));
    for (size_t k = 0; k < 3; ++k) {
      if (IsApart(face, transform(ToDouble(normals[indices[i + k]])), cosine_max)) return true;
    }
  }
  return false;
}

}  // namespace

bool KeepsAngles(const Affine& transform) {
  constexpr double kRounding = 1e-6;  // Files write matrices with six or more digits.
  const double xx = LengthSquared(transform.x), yy = LengthSquared(transform.y),
               zz = LengthSquared(transform.z);
  const double limit = kRounding * xx;
  return std::fabs(yy - xx) <= limit && std::fabs(zz - xx) <= limit &&
         std::fabs(Dot(transform.x, transform.y)) <= limit &&
         std::fabs(Dot(transform.y, transform.z)) <= limit &&
         std::fabs(Dot(transform.z, transform.x)) <= limit;
}

bool IsTilted(const TriangleMesh& mesh, const Affine& target_from_mesh, double cosine_max) {
  const NormalTransform transform(target_from_mesh);
  if (IsTilted(mesh.positions, mesh.normals, mesh.indices, transform, cosine_max)) return true;
  for (const VertexStep& step : mesh.steps) {
    if (IsTilted(step.positions, step.normals, mesh.indices, transform, cosine_max)) return true;
  }
  return false;
}

bool IsTilted(const BilinearMesh& mesh, const Affine& target_from_mesh, double cosine_max) {
  if (mesh.normals.empty()) return false;
  const NormalTransform transform(target_from_mesh);
  for (size_t i = 0; i + 3 < mesh.indices.size(); i += 4) {
    const auto at = [&](const std::vector<Vec3f>& values, size_t k) {
      return ToDouble(values[mesh.indices[i + k]]);
    };
    const auto patch = [&](const std::vector<Vec3f>& values) {
      return BilinearPatch{at(values, 0), at(values, 1), at(values, 2), at(values, 3)};
    };
    const BilinearPatch shape = patch(mesh.positions), normals = patch(mesh.normals);
    // Both are smooth between the corners: the center and the corners tell a bent patch.
    for (const auto& [u, v] :
         {std::pair(0.0, 0.0), {1.0, 0.0}, {0.0, 1.0}, {1.0, 1.0}, {0.5, 0.5}}) {
      if (IsApart(transform(shape.NormalAt(u, v)), transform(normals.PointAt(u, v)), cosine_max))
        return true;
    }
  }
  return false;
}

}  // namespace sheaf::render
