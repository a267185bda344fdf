// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Finds closed meshes, and makes probe and retry rays.
#include "worker/render/geometry/leak_guard.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "common/math/elementary.h"
#include "worker/render/geometry/deforming_mesh.h"
#include "worker/render/geometry/raw_hit.h"

namespace sheaf::render {

EnclosedSide EnclosedSideOf(const BakedMesh& mesh) {
  const EnclosedSide side = EnclosedSideOf(mesh.positions, mesh.indices);
  for (const VertexStep& step : mesh.steps) {
    if (EnclosedSideOf(step.positions, mesh.indices) != side) return EnclosedSide::kNeither;
  }
  return side;
}

LeakGuard::LeakGuard(const SceneGeometry& geometry) : geometry_(&geometry) {
  for (const GeometryGroup& group : geometry.groups) {
    std::vector<EnclosedSide>& sides = sides_.emplace_back();
    for (const BakedMesh& mesh : group.meshes) {
      sides.push_back(EnclosedSideOf(mesh));
    }
  }
}

Ray ProbeRay(uint32_t index) {
  // Equal steps of height and of the golden angle; render space is centered at the camera. Source:
  // Swinbank and Purser 2006, "Fibonacci grids".
  constexpr double kGoldenAngle = std::numbers::pi * (3 - 2.23606797749978969641);
  const double height = 1 - (2 * static_cast<double>(index) + 1) / kProbeCount;
  const double radius = std::sqrt(1 - height * height);
  const double angle = kGoldenAngle * static_cast<double>(index);
  Ray ray;
  ray.d = ToFloat(Vec3d{radius * Cos(angle), height, radius * Sin(angle)});
  return ray;
}

bool LeakGuard::IsEnclosed(const Ray& ray) const {
  if (camera_is_enclosed_) return true;
  const PrimitiveId source = ray.source;
  if (source == PrimitiveId{}) return false;
  const PlacedGroup* placed = nullptr;
  if (source.placed != kNotPlaced) {
    const size_t still_count = geometry_->still.size();
    placed = source.placed < still_count ? &geometry_->still[source.placed]
                                         : &geometry_->moving[source.placed - still_count];
  }
  const uint32_t group = placed == nullptr ? 0 : placed->group;
  const std::vector<EnclosedSide>& sides = sides_[group];
  if (source.geometry >= sides.size()) return false;  // Doubles leave no holes.
  const EnclosedSide side = sides[source.geometry];
  if (side == EnclosedSide::kNeither) return false;
  const BakedMesh& mesh = geometry_->groups[group].meshes[source.geometry];
  const uint32_t* t = &mesh.indices[3 * static_cast<size_t>(source.primitive)];
  const auto [a, b, c] = CornersAt(mesh, t, ray.time);
  const Vec3d front = Cross(b - a, c - a);
  Vec3d d = ToDouble(ray.d);
  if (placed != nullptr) d = GroupFromRenderAt(*geometry_, *placed, ray.time).Vector(d);
  return (Dot(front, d) > 0) == (side == EnclosedSide::kFront);
}

Ray NudgedRay(const Ray& ray, int attempt) {
  Ray nudged = ray;
  const float length =
      std::max(std::fabs(ray.d.x), std::max(std::fabs(ray.d.y), std::fabs(ray.d.z)));
  const float step = std::ldexp(length, 2 * attempt - 21);
  uint64_t state = HashOfPoint(ray.d, HashOfPoint(ray.o, static_cast<uint64_t>(attempt)));
  for (size_t i = 0; i < 3; ++i) {
    const auto number = static_cast<int32_t>(state >> (21 * i) & 0x1fffff) - (1 << 20);
    nudged.d[i] += step * (static_cast<float>(number) * 0x1p-20f);
  }
  return nudged;
}

}  // namespace sheaf::render
