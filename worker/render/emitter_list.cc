// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Emissive shapes to light table input.
#include "worker/render/emitter_list.h"

#include <cmath>
#include <numbers>

namespace sheaf::render {
namespace {

// How far the axes of a transform may differ in length, or lean to each other, for a sphere to stay
// a sphere: rounding of the transforms in a scene file written with six digits.
constexpr double kSimilarityTolerance = 1e-5;

// What a light's colour is multiplied by where its shapes have the given area in all.
float ScaleOf(const AreaLightDescription& light, double area) {
  if (!(light.scale.power_w > 0)) return light.scale.scale;
  // A diffuse emitter's power is pi times area times radiance, for each side.
  const double sides = light.two_sided ? 2 : 1;
  const double power_now = std::numbers::pi * area * sides * Luminance(light.radiance.rgb);
  return power_now > 0 ? static_cast<float>(light.scale.power_w / power_now) : 0;
}

Vec3d TriangleCross(const BakedMesh& mesh, const uint32_t* t) {
  const Vec3d p0 = ToDouble(mesh.positions[t[0]]);
  return Cross(ToDouble(mesh.positions[t[1]]) - p0, ToDouble(mesh.positions[t[2]]) - p0);
}

}  // namespace

Emission EmitterList::EmissionOf(int32_t light, double area) const {
  const AreaLightDescription& description = lights_[static_cast<size_t>(light)];
  return {description.radiance, ScaleOf(description, area), light};
}

uint32_t EmitterList::AddMesh(const BakedMesh& mesh, int32_t light) {
  double area = 0;
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    area += 0.5 * Length(TriangleCross(mesh, &mesh.indices[i]));
  }
  const Emission radiance = EmissionOf(light, area);
  if (radiance.rgb.IsBlack()) return kNoEmitter;
  const bool two_sided = lights_[static_cast<size_t>(light)].two_sided;
  const auto first = static_cast<uint32_t>(input_.triangles.size());
  for (size_t i = 0; i < mesh.indices.size(); i += 3) {
    const uint32_t* t = &mesh.indices[i];
    TriangleEmitter emitter{mesh.positions[t[0]], mesh.positions[t[1]], mesh.positions[t[2]],
                            radiance, two_sided};
    if (TriangleFacing(mesh, t, TriangleCross(mesh, t)) < 0) std::swap(emitter.v1, emitter.v2);
    input_.triangles.push_back(emitter);
  }
  return first;
}

std::string EmitterList::ProblemWith(const Quadric& q) {
  const Affine& m = q.target_from_object;
  const double x = Length(m.x), y = Length(m.y), z = Length(m.z);
  const double tolerance = kSimilarityTolerance * x;
  const bool round_xy = std::fabs(x - y) <= tolerance && std::fabs(Dot(m.x, m.y)) <= tolerance * y;
  if (q.kind == Quadric::Kind::kSphere) {
    const bool round = round_xy && std::fabs(x - z) <= tolerance &&
                       std::fabs(Dot(m.x, m.z)) <= tolerance * z &&
                       std::fabs(Dot(m.y, m.z)) <= tolerance * z;
    if (!round || q.is_partial) {
      return "Shape \"sphere\": as an area light it must be whole and scaled alike along all axes; "
             "use a triangle mesh for other shapes";
    }
    return "";
  }
  if (q.kind == Quadric::Kind::kCylinder) {
    return "Shape \"cylinder\": it cannot be an area light; use a triangle mesh";
  }
  if (!round_xy || q.phi_max < 2 * std::numbers::pi) {
    return "Shape \"disk\": as an area light it must be round and go all the way about (phimax "
           "360); "
           "use a triangle mesh for other shapes";
  }
  return "";
}

uint32_t EmitterList::AddQuadric(const Quadric& q, bool flips, int32_t light) {
  const Affine& m = q.target_from_object;
  const double scale = Length(m.x);
  const bool two_sided = lights_[static_cast<size_t>(light)].two_sided;
  if (q.kind == Quadric::Kind::kSphere) {
    const double radius = q.radius * scale;
    const Emission radiance = EmissionOf(light, 4 * std::numbers::pi * radius * radius);
    if (radiance.rgb.IsBlack()) return kNoEmitter;
    input_.spheres.push_back({m.offset, radius, radiance, two_sided, flips});
    return static_cast<uint32_t>(input_.spheres.size() - 1);
  }
  const double outer = q.radius * scale, inner = q.inner_radius * scale;
  const Emission radiance = EmissionOf(light, std::numbers::pi * (outer - inner) * (outer + inner));
  if (radiance.rgb.IsBlack()) return kNoEmitter;
  const Vec3d normal = Normalize(q.object_from_target.TransposedVector({0, 0, 1}));
  input_.disks.push_back({m.Point({0, 0, q.z_min}), flips ? -normal : normal, Normalize(m.x), outer,
                          inner, radiance, two_sided});
  return static_cast<uint32_t>(input_.disks.size() - 1);
}

void EmitterList::AssignIds(GeometryGroup* world) const {
  const auto first_sphere = static_cast<uint32_t>(input_.triangles.size());
  const auto first_disk = static_cast<uint32_t>(first_sphere + input_.spheres.size());
  for (BakedQuadric& q : world->quadrics) {
    if (q.surface.emitter == kNoEmitter) continue;
    q.surface.emitter += q.quadric.kind == Quadric::Kind::kSphere ? first_sphere : first_disk;
  }
}

}  // namespace sheaf::render
