// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Normal and bump maps. The meaning of the maps follows pbrt-v4, sec. 10.1.2 and its function
// NormalMap, with two differences. Green is along v also where u and v are mirrored relative to the
// normal, so that a normal map and the bump map it was made from look alike on every surface; and
// the derivative of the normal times the height is ignored: it is small for the small heights of a
// bump map.
#include <cmath>

#include "worker/render/bsdf/perturbed_normal.h"
#include "worker/render/material/material.h"
#include "worker/render/material/material_impl.h"

namespace sheaf::render {
namespace {

bool IsUsable(Vec3d n) {
  const double length_squared = LengthSquared(n);
  return length_squared > 0 && std::isfinite(length_squared);
}

Vec3d NormalOfTexel(Rgb texel, double scale, const TangentPlane& plane) {
  const double r = 2 * static_cast<double>(texel.r) - 1, g = 2 * static_cast<double>(texel.g) - 1,
               b = 2 * static_cast<double>(texel.b) - 1;
  const Vec3d tangent = TangentOf(plane, plane.n);
  const double length = Length(tangent);
  if (!(length > 0) || !std::isfinite(length)) return plane.n;
  const Vec3d x = tangent / length;
  Vec3d y = Cross(plane.n, x);
  if (Dot(plane.n, Cross(plane.dpdu, plane.dpdv)) < 0) y = -y;
  return x * (scale * r) + y * (scale * g) + plane.n * b;
}

// The unnormalized normal of p + height n. du, dv: slopes of the height.
Vec3d NormalOfSlopes(double du, double dv, const TangentPlane& plane) {
  const double area = Dot(plane.n, Cross(plane.dpdu, plane.dpdv));
  if (!(std::fabs(area) > 0)) return plane.n;
  const Vec3d gradient = (Cross(plane.dpdv, plane.n) * du + Cross(plane.n, plane.dpdu) * dv) / area;
  return plane.n - gradient;
}

}  // namespace

Vec3f MaterialTable::ShadingNormal(int32_t material, const TexturePoint& point, float u_mix,
                                   const TangentPlane& plane) const {
  const Vec3f plain = ToFloat(plane.n);
  if (material == kNone || !plane.has_tangents) return plain;
  const TextureProgram& textures = *impl_->textures;
  const CompiledMaterial& chosen =
      ChooseMaterial(impl_->materials, textures, material, point, u_mix);
  Vec3d n = plane.n;
  if (chosen.normal_map != kNone) {
    n = NormalOfTexel(textures.Value<Rgb>({chosen.normal_map, {}, {}}, point, {}),
                      static_cast<double>(chosen.normal_scale), plane);
  } else if (chosen.displacement.texture != kNone) {
    const auto height = [&](double du, double dv) {
      TexturePoint there = point;
      there.p_world = point.p_world + plane.dpdu * du + plane.dpdv * dv;
      there.uv_shift = {du, dv};
      return static_cast<double>(textures.Float(chosen.displacement, there));
    };
    const Vec2d step = textures.SlopeStep(chosen.slope_scale, point, plane.dpdu, plane.dpdv);
    const double slope_u = (height(step.x, 0) - height(-step.x, 0)) / (2 * step.x);
    const double slope_v = (height(0, step.y) - height(0, -step.y)) / (2 * step.y);
    n = NormalOfSlopes(slope_u, slope_v, plane);
  } else {
    return plain;
  }
  // Flat texels return exactly the unperturbed normal.
  return IsUsable(n) && n != plane.n ? ToFloat(n / Length(n)) : plain;
}

std::optional<Vec3f> MaterialTable::CoatNormal(int32_t material, const TexturePoint& point,
                                               float u_mix, const TangentPlane& plane) const {
  if (material == kNone || !plane.has_tangents) return std::nullopt;
  const TextureProgram& textures = *impl_->textures;
  const CompiledMaterial& chosen =
      ChooseMaterial(impl_->materials, textures, material, point, u_mix);
  if (!chosen.coat_normals) return std::nullopt;
  const Vec3f plain = ToFloat(plane.n);
  if (chosen.coat_normals->map == kNone) return plain;
  const Vec3d n = NormalOfTexel(textures.Value<Rgb>({chosen.coat_normals->map, {}, {}}, point, {}),
                                static_cast<double>(chosen.coat_normals->scale), plane);
  return IsUsable(n) && n != plane.n ? ToFloat(n / Length(n)) : plain;
}

void MaterialTable::TiltCoat(int32_t material, const TexturePoint& point, float u_mix,
                             const TangentPlane& plane, const CoatView& view,
                             BsdfShape* bsdf) const {
  if (bsdf->kind != BsdfKind::kPrincipled || bsdf->top.coat == 0) return;
  bsdf->coat_tilt = {};
  const std::optional<Vec3f> mapped = CoatNormal(material, point, u_mix, plane);
  if (!mapped) return;
  const Vec3f n = BendNormal(LiftNormal(*mapped, view.ng), view.ng, view.wo);
  const Vec3f local = view.shading.ToLocal(n);
  if (local.z > 0) bsdf->coat_tilt = CoatTilt::Of(local);
}

}  // namespace sheaf::render
