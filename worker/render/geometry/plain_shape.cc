// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/geometry/plain_shape.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <variant>

#include "common/math/elementary.h"

namespace sheaf::render {
namespace {

struct SurfaceSpot {
  Vec3f p, n;
};

// A grid of quads over [0, 1]^2, cut into triangles that wind around the normals.
template <typename Surface>
void AddGrid(uint32_t steps, const Surface& surface, TriangleMesh* mesh) {
  const auto first = static_cast<uint32_t>(mesh->positions.size());
  const uint32_t columns = steps + 1;
  for (uint32_t j = 0; j < columns; ++j) {
    for (uint32_t i = 0; i < columns; ++i) {
      const Vec2f uv{static_cast<float>(i) / static_cast<float>(steps),
                     static_cast<float>(j) / static_cast<float>(steps)};
      const SurfaceSpot spot = surface(uv);
      mesh->positions.push_back(spot.p);
      mesh->normals.push_back(spot.n);
      mesh->uvs.push_back(uv);
    }
  }
  const auto add = [mesh](uint32_t a, uint32_t b, uint32_t c) {
    const Vec3f cross =
        Cross(mesh->positions[b] - mesh->positions[a], mesh->positions[c] - mesh->positions[a]);
    if (Dot(cross, mesh->normals[a] + mesh->normals[b] + mesh->normals[c]) < 0) std::swap(b, c);
    mesh->indices.insert(mesh->indices.end(), {a, b, c});
  };
  for (uint32_t j = 0; j < steps; ++j) {
    for (uint32_t i = 0; i < steps; ++i) {
      const uint32_t corner = first + j * columns + i;
      add(corner, corner + 1, corner + columns + 1);
      add(corner, corner + columns + 1, corner + columns);
    }
  }
}

float Radians(float degrees) { return degrees * static_cast<float>(kPi / 180); }
float Between(float a, float b, float x) { return a + (b - a) * x; }

TriangleMesh MeshOf(const SphereShape& s, uint32_t steps) {
  const float low = std::clamp(std::min(s.z_min, s.z_max) / s.radius, -1.0f, 1.0f);
  const float high = std::clamp(std::max(s.z_min, s.z_max) / s.radius, -1.0f, 1.0f);
  TriangleMesh mesh;
  AddGrid(
      steps,
      [&](Vec2f uv) -> SurfaceSpot {
        const float theta = Between(Acos(low), Acos(high), uv.y);
        const float phi = uv.x * Radians(s.phi_max_degrees);
        const Vec3f n{Sin(theta) * Cos(phi), Sin(theta) * Sin(phi), Cos(theta)};
        return {s.radius * n, n};
      },
      &mesh);
  return mesh;
}

TriangleMesh MeshOf(const DiskShape& d, uint32_t steps) {
  TriangleMesh mesh;
  AddGrid(
      steps,
      [&](Vec2f uv) -> SurfaceSpot {
        const float r = Between(d.radius, d.inner_radius, uv.y);
        const float phi = uv.x * Radians(d.phi_max_degrees);
        return {{r * Cos(phi), r * Sin(phi), d.height}, {0, 0, 1}};
      },
      &mesh);
  return mesh;
}

TriangleMesh MeshOf(const CylinderShape& c, uint32_t steps) {
  TriangleMesh mesh;
  AddGrid(
      steps,
      [&](Vec2f uv) -> SurfaceSpot {
        const float phi = uv.x * Radians(c.phi_max_degrees);
        const Vec3f n{Cos(phi), Sin(phi), 0};
        return {c.radius * n + Vec3f{0, 0, Between(c.z_min, c.z_max, uv.y)}, n};
      },
      &mesh);
  return mesh;
}

TriangleMesh MeshOf(const BilinearMesh& patches) {
  TriangleMesh mesh;
  for (size_t at = 0; at < patches.indices.size(); at += 4) {
    const Vec3f p00 = patches.positions[patches.indices[at]];
    const Vec3f p10 = patches.positions[patches.indices[at + 1]];
    const Vec3f p01 = patches.positions[patches.indices[at + 2]];
    const Vec3f p11 = patches.positions[patches.indices[at + 3]];
    AddGrid(
        kPlainShapeSteps,
        [&](Vec2f uv) -> SurfaceSpot {
          const Vec3f low = p00 + (p10 - p00) * uv.x, high = p01 + (p11 - p01) * uv.x;
          const Vec3f along_u = (p10 - p00) * (1 - uv.y) + (p11 - p01) * uv.y;
          const Vec3f n = Cross(along_u, high - low);
          const float length = Length(n);
          return {low + (high - low) * uv.y, length > 0 ? n / length : Vec3f{0, 0, 1}};
        },
        &mesh);
  }
  return mesh;
}

// Removes the triangles without area, as at the poles of spheres: they would be reported as those
// of the user's meshes are.
void RemoveCollapsed(TriangleMesh* mesh) {
  std::vector<uint32_t> kept;
  for (size_t at = 0; at < mesh->indices.size(); at += 3) {
    const Vec3d a = ToDouble(mesh->positions[mesh->indices[at]]);
    const Vec3d b = ToDouble(mesh->positions[mesh->indices[at + 1]]);
    const Vec3d c = ToDouble(mesh->positions[mesh->indices[at + 2]]);
    if (!(LengthSquared(Cross(b - a, c - a)) > 0)) continue;
    kept.insert(kept.end(), mesh->indices.begin() + static_cast<std::ptrdiff_t>(at),
                mesh->indices.begin() + static_cast<std::ptrdiff_t>(at + 3));
  }
  mesh->indices = std::move(kept);
}

}  // namespace

std::optional<TriangleMesh> TrianglesOf(const ShapeDescription& shape, uint32_t steps) {
  if (const auto* sphere = std::get_if<SphereShape>(&shape.shape)) return MeshOf(*sphere, steps);
  if (const auto* disk = std::get_if<DiskShape>(&shape.shape)) return MeshOf(*disk, steps);
  if (const auto* cylinder = std::get_if<CylinderShape>(&shape.shape)) {
    return MeshOf(*cylinder, steps);
  }
  return std::nullopt;
}

void MakePlain(SceneDescription* scene) {
  for (ShapeDescription& shape : scene->shapes) {
    std::optional<TriangleMesh> mesh = TrianglesOf(shape, kPlainShapeSteps);
    if (const auto* patches = std::get_if<BilinearMeshShape>(&shape.shape)) {
      mesh = MeshOf(scene->bilinear_meshes[static_cast<size_t>(patches->mesh)]);
    }
    if (!mesh.has_value()) continue;
    RemoveCollapsed(&*mesh);
    shape.shape = MeshShape{static_cast<int32_t>(scene->meshes.size())};
    scene->meshes.push_back(*std::move(mesh));
  }
}

}  // namespace sheaf::render
