// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sampling of emissive shapes for light_table.cc: samples one emitter in the form of the light
// table, and applies the image or the alpha cut-out of its shape.
#pragma once

#include <cmath>
#include <optional>

#include "worker/render/light/light_table.h"
#include "worker/render/light/light_table_impl.h"
#include "worker/render/light/shape_sampling.h"

namespace sheaf::render {

// Rounding a double to a float costs half an ulp; doubled to allow for the double arithmetic.
inline Vec3f RoundingErrorOf(Vec3f p) {
  return {std::fabs(p.x) * 0x1p-23f, std::fabs(p.y) * 0x1p-23f, std::fabs(p.z) * 0x1p-23f};
}

inline bool IsUsablePdf(float pdf) { return pdf > 0 && std::isfinite(pdf); }

inline float PdfSolidAngle(double shape_pdf, float probability) {
  return static_cast<float>(shape_pdf) * probability;
}

// Sets a new sample but for its pdf.
template <typename Color>
void SetAreaSample(const ShapePoint& point, const Color& radiance, LightSampleOf<Color>* sample) {
  sample->wi = ToFloat(point.wi);
  sample->p_light = ToFloat(point.p);
  sample->p_light_error = RoundingErrorOf(sample->p_light);
  sample->n_light = ToFloat(point.n);
  sample->radiance = radiance;
}
template <typename Color>
LightSampleOf<Color> AreaSample(const ShapePoint& point, const Color& radiance) {
  LightSampleOf<Color> sample;
  SetAreaSample(point, radiance, &sample);
  return sample;
}

inline DiskShapeView ViewEmitter(const DiskEmitter& disk, Vec3f p) {
  return ViewDisk(disk.center, disk.normal, disk.axis_x, disk.radius, disk.inner_radius, p);
}
[[gnu::always_inline]] inline TriangleView ViewEmitter(const TriangleEmitter& t, Vec3f p) {
  return ViewTriangle(t.v0, t.v1, t.v2, p);
}
// A point on the sphere counts as inside if the sphere emits inwards: there the whole wall
// illuminates it, while no part of a sphere illuminates its own outside.
[[gnu::always_inline]] inline SphereView ViewEmitter(const SphereEmitter& s, Vec3f p) {
  return ViewSphere(s.center, s.radius, s.inward || s.two_sided, p);
}

// Sets *out to a sample of the emitter, if p sees it. In place: a copy of a sample waits for the
// stores that made it. Requires: *out is empty.
template <typename Color>
void SampleEmitter(const TriangleEmitter& t, const Color& radiance, float probability, Vec3f p,
                   Vec2f u, std::optional<LightSampleOf<Color>>* out) {
  const TriangleView view = ViewEmitter(t, p);
  if (!view.visible || !(view.front() || t.two_sided)) return;
  LightSampleOf<Color>& sample = out->emplace();
  SetAreaSample(SampleTriangle(view, t.v0, p, u), radiance, &sample);
  sample.pdf = PdfSolidAngle(PdfTriangle(view, p, sample.p_light), probability);
}

template <typename Color>
void SampleEmitter(const SphereEmitter& s, const Color& radiance, float probability, Vec3f p,
                   Vec2f u, std::optional<LightSampleOf<Color>>* out) {
  const SphereView view = ViewEmitter(s, p);
  if (!view.visible || !(s.two_sided || view.inside == s.inward)) return;
  const ShapePoint point = SampleSphere(view, s.center, s.radius, u);
  // If p is on a two-sided sphere, samples must be farther than the rounding error.
  const double distance = Dot(point.p - ToDouble(p), point.wi);
  if (s.two_sided && view.inside && !(distance > view.error)) return;
  LightSampleOf<Color>& sample = out->emplace();
  SetAreaSample(point, radiance, &sample);
  sample.pdf = PdfSolidAngle(view.pdf, probability);
}

template <typename Color>
void SampleEmitter(const DiskEmitter& d, const Color& radiance, float probability, Vec3f p, Vec2f u,
                   std::optional<LightSampleOf<Color>>* out) {
  const DiskShapeView view = ViewEmitter(d, p);
  if (!view.visible || !(view.front() || d.two_sided)) return;
  bool hit = false;
  const ShapePoint point = SampleDisk(view, p, u, &hit);
  if (!hit) return;
  LightSampleOf<Color>& sample = out->emplace();
  SetAreaSample(point, radiance, &sample);
  sample.pdf = PdfSolidAngle(PdfDisk(view, p, sample.wi, sample.p_light), probability);
}

// Texture coordinates at a point of an emitter.
inline Vec2f UvOnTriangle(const TriangleEmitter& t, const EmissionDetail& detail, Vec3f p) {
  const Vec3d v0 = ToDouble(t.v0), e1 = ToDouble(t.v1) - v0, e2 = ToDouble(t.v2) - v0;
  const Vec3d normal = Cross(e1, e2), d = ToDouble(p) - v0;
  const double square = LengthSquared(normal);
  const auto b1 = static_cast<float>(Dot(Cross(d, e2), normal) / square);
  const auto b2 = static_cast<float>(Dot(Cross(e1, d), normal) / square);
  return detail.uv[0] + b1 * (detail.uv[1] - detail.uv[0]) + b2 * (detail.uv[2] - detail.uv[0]);
}
inline Vec2f UvOnQuadric(const Quadric& quadric, Vec3f p) {
  return QuadricParametersAt(quadric, quadric.object_from_target.Point(ToDouble(p))).uv;
}

template <typename Color>
Color RadianceOfMap(const LightTable::Impl& impl, const EmissionDetail& detail, Vec2f uv,
                    const WavelengthsOf<Color>& wavelengths) {
  const Rgb seen = impl.maps[static_cast<size_t>(detail.map)]->At(uv);
  return ColorOfRgb<Color>(seen * detail.map_scale, ColorRole::kIlluminant, wavelengths);
}

// Applies the emission details of the emitter at the sampled point.
template <typename Color>
void AddDetail(const LightTable::Impl& impl, uint32_t emitter,
               const WavelengthsOf<Color>& wavelengths, LightSampleOf<Color>* sample) {
  const EmissionDetail* detail = impl.DetailOf(emitter);
  if (detail == nullptr) return;
  if (detail->quadric != kNone) {
    sample->uv = UvOnQuadric(impl.quadrics[static_cast<size_t>(detail->quadric)], sample->p_light);
  } else {
    // A sub-triangle may lie off the triangle by the rounding of its own corners.
    const TriangleEmitter& t = impl.triangles[emitter];
    for (size_t i = 0; i < 3; ++i) {
      const float reach =
          std::fmax(std::fabs(t.v0[i]), std::fmax(std::fabs(t.v1[i]), std::fabs(t.v2[i])));
      sample->p_light_error[i] += reach * 0x1p-23f;
    }
    sample->uv = UvOnTriangle(t, *detail, sample->p_light);
  }
  if (detail->map != kNone) {
    sample->radiance = RadianceOfMap<Color>(impl, *detail, sample->uv, wavelengths);
  }
  sample->is_delta = detail->is_unseen;
  sample->cut_out = detail->cut_out;
}

// Sets where a ray begins, at a sampled point of the emitter, and its power. Requires: ray->w.
// Ray: EmittedRayOf<Color>.
template <typename Color, typename Ray>
void BeginAt(const LightTable::Impl& impl, uint32_t emitter,
             const WavelengthsOf<Color>& wavelengths, LightSampleOf<Color> point, Ray* ray) {
  AddDetail<Color>(impl, emitter, wavelengths, &point);
  ray->p = point.p_light;
  ray->p_error = point.p_light_error;
  ray->n = point.n_light;
  ray->power = point.radiance * std::fabs(Dot(ray->n, ray->w));
  ray->is_unseen = point.is_delta;
  ray->cut_out = point.cut_out;
  ray->uv = point.uv;
}

}  // namespace sheaf::render
