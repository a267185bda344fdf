// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sampling and evaluating lights. light_table_build.cc makes them from the scene.
#include "worker/render/light_table.h"

#include <cmath>

#include "common/math/elementary.h"
#include "worker/render/light_table_impl.h"
#include "worker/render/shape_sampling.h"

namespace sheaf::render {
namespace {

// Rounding a double to a float costs half an ulp; twice that leaves room for the double arithmetic.
Vec3f RoundingErrorOf(Vec3f p) {
  return {std::fabs(p.x) * 0x1p-23f, std::fabs(p.y) * 0x1p-23f, std::fabs(p.z) * 0x1p-23f};
}

bool IsUsablePdf(float pdf) { return pdf > 0 && std::isfinite(pdf); }

float PdfSolidAngle(double shape_pdf, float probability) {
  return static_cast<float>(shape_pdf) * probability;
}

Vec3f Rotate(const Vec3f (&rows)[3], Vec3f v) {
  return {Dot(rows[0], v), Dot(rows[1], v), Dot(rows[2], v)};
}
Vec3d RotateBack(const Vec3f (&rows)[3], Vec3d v) {
  return v.x * ToDouble(rows[0]) + v.y * ToDouble(rows[1]) + v.z * ToDouble(rows[2]);
}

// Smooth step of pbrt-v4's spot light: 0 at `low`, 1 at `high`.
float SmoothStep(float x, float low, float high) {
  if (!(x > low)) return 0;
  if (x >= high) return 1;
  const float t = (x - low) / (high - low);
  return t * t * (3 - 2 * t);
}

LightSample AreaSample(const ShapePoint& point, Rgb radiance, float pdf) {
  LightSample sample;
  sample.wi = ToFloat(point.wi);
  sample.p_light = ToFloat(point.p);
  sample.p_light_error = RoundingErrorOf(sample.p_light);
  sample.n_light = ToFloat(point.n);
  sample.radiance = radiance;
  sample.pdf = pdf;
  return sample;
}

DiskShapeView View(const DiskEmitter& disk, Vec3f p) {
  return ViewDisk(disk.center, disk.normal, disk.axis_x, disk.radius, disk.inner_radius, p);
}
TriangleView View(const TriangleEmitter& t, Vec3f p) { return ViewTriangle(t.v0, t.v1, t.v2, p); }
SphereView View(const SphereEmitter& s, Vec3f p) {
  return ViewSphere(s.center, s.radius, s.inward && !s.two_sided, p);
}

std::optional<LightSample> Sample(const TriangleEmitter& t, float probability, Vec3f p, Vec2f u) {
  const TriangleView view = View(t, p);
  if (!view.visible || !(view.front() || t.two_sided)) return std::nullopt;
  const ShapePoint point = SampleTriangle(view, t.v0, p, u);
  LightSample sample = AreaSample(point, t.radiance, 0);
  sample.pdf = PdfSolidAngle(PdfTriangle(view, p, sample.p_light), probability);
  return sample;
}

std::optional<LightSample> Sample(const SphereEmitter& s, float probability, Vec3f p, Vec2f u) {
  const SphereView view = View(s, p);
  if (!view.visible || !(s.two_sided || view.inside == s.inward)) return std::nullopt;
  return AreaSample(SampleSphere(view, s.center, s.radius, u), s.radiance,
                    PdfSolidAngle(view.pdf, probability));
}

std::optional<LightSample> Sample(const DiskEmitter& d, float probability, Vec3f p, Vec2f u) {
  const DiskShapeView view = View(d, p);
  if (!view.visible || !(view.front() || d.two_sided)) return std::nullopt;
  bool hit = false;
  const ShapePoint point = SampleDisk(view, p, u, &hit);
  if (!hit) return std::nullopt;
  LightSample sample = AreaSample(point, d.radiance, 0);
  sample.pdf = PdfSolidAngle(PdfDisk(view, p, sample.wi, sample.p_light), probability);
  return sample;
}

std::optional<LightSample> Sample(const DeltaLight& light, float probability, Vec3f p) {
  LightSample sample;
  sample.is_delta = true;
  sample.pdf = probability;
  if (light.kind == DeltaLight::Kind::kDistant) {
    sample.wi = light.to_light;
    sample.radiance = light.emission;
    sample.is_infinite = true;
    return sample;
  }
  const Vec3d to_light = light.position - ToDouble(p);
  const double d_squared = LengthSquared(to_light);
  if (!(d_squared > 0)) return std::nullopt;
  sample.wi = ToFloat(to_light / std::sqrt(d_squared));
  sample.p_light = ToFloat(light.position);
  sample.p_light_error = RoundingErrorOf(sample.p_light);
  sample.radiance = IntensityAlong(light, -sample.wi) * static_cast<float>(1 / d_squared);
  return sample;
}

EnvironmentMap::Place PlaceOf(const InfiniteEmitter& light, Vec3f d) {
  if (!light.map) return {};
  return light.map->Locate(Rotate(light.light_from_render, d));
}

// place: of the direction, where there is a map.
Rgb RadianceAt(const InfiniteEmitter& light, EnvironmentMap::Place place) {
  return light.map ? light.map->Radiance(place) * light.scale : light.radiance;
}

// Measure: solid angle.
double PdfAt(const InfiniteEmitter& light, EnvironmentMap::Place place) {
  return light.map ? static_cast<double>(light.map->Pdf(place)) : 1 / (4 * kPi);
}

// Requires: light.map.
Vec3f DirectionOf(const InfiniteEmitter& light, EnvironmentMap::Place place) {
  return ToFloat(RotateBack(light.light_from_render, light.map->Direction(place)));
}

Vec3f UniformDirection(Vec2f u) {
  const double z = 1 - 2 * static_cast<double>(u.x);
  const double r = std::sqrt(1 - z * z);
  const SinCosPair<double> phi = SinCos(2 * kPi * static_cast<double>(u.y));
  return ToFloat({r * phi.cos, r * phi.sin, z});
}

}  // namespace

Rgb IntensityAlong(const DeltaLight& light, Vec3f w) {
  if (light.kind == DeltaLight::Kind::kPoint) return light.emission;
  const Vec3f w_light = Rotate(light.light_from_render, w);
  const float cosine = Dot(w_light, light.axis) / Length(w_light);
  return light.emission * SmoothStep(cosine, light.cos_end, light.cos_start);
}

LightTable::LightTable() = default;
LightTable::~LightTable() = default;

bool LightTable::empty() const { return impl_->empty; }

template <uint32_t kMask>
std::optional<LightSample> LightTable::SampleLights(const Impl& impl, Vec3f p, Vec3f n,
                                                    float u_select, Vec2f u,
                                                    const Preparation& preparation) {
  if (impl.empty) return std::nullopt;
  const std::optional<ChosenLight> chosen = impl.choice.Choose(p, u_select, SaltOf(u));
  if (!chosen) return std::nullopt;
  const uint32_t light = chosen->light;
  std::optional<LightSample> sample;
  if (light < impl.first_delta()) {
    if constexpr (Has(kMask, Trait::kAreaLights)) {
      if (light < impl.first_sphere()) {
        sample = render::Sample(impl.triangles[light], chosen->probability, p, u);
      } else if constexpr (Has(kMask, Trait::kQuadrics)) {
        sample =
            light < impl.first_disk()
                ? render::Sample(impl.spheres[light - impl.first_sphere()], chosen->probability, p,
                                 u)
                : render::Sample(impl.disks[light - impl.first_disk()], chosen->probability, p, u);
      }
    }
  } else if (light < impl.first_infinite()) {
    if constexpr (Has(kMask, Trait::kDeltaLights)) {
      sample = render::Sample(impl.deltas[light - impl.first_delta()], chosen->probability, p);
    }
  } else if constexpr (Has(kMask, Trait::kEnvironment)) {
    // Infinite lights share every direction, so each is drawn as a part of their sum.
    sample.emplace();
    const uint32_t index = light - impl.first_infinite();
    const InfiniteEmitter& infinite = impl.infinites[index];
    EnvironmentMap::Place place;
    if (infinite.map) {
      place = impl.HasOnlyOneMap() ? preparation.sky.place : infinite.map->Sample(u).place;
      sample->wi = DirectionOf(infinite, place);
    } else {
      sample->wi = UniformDirection(u);
    }
    if (Dot(sample->wi, n) < 0) return std::nullopt;  // Not worth waiting for the radiance.
    if (impl.HasOnlyOneMap()) {
      sample->radiance = RadianceAt(infinite, place);
      sample->pdf = preparation.sky.pdf;
    } else {
      const EnvironmentValue value = FromInfinity(impl, p, n, sample->wi, index, place);
      sample->radiance = value.radiance;
      sample->pdf = value.pdf;
    }
    sample->is_infinite = true;
  }
  const bool usable = sample && IsUsablePdf(sample->pdf) && IsFinite(sample->radiance) &&
                      !sample->radiance.IsBlack();
  return usable ? sample : std::nullopt;
}

template <uint32_t kMask>
float LightTable::PdfOfEmitter(const Impl& impl, uint32_t emitter, Vec3f p, Vec3f /*n*/, Vec3f wi,
                               Vec3f p_light) {
  double shape_pdf = 0;
  if constexpr (Has(kMask, Trait::kAreaLights)) {
    if (emitter < impl.first_sphere()) {
      shape_pdf = PdfTriangle(View(impl.triangles[emitter], p), p, p_light);
    } else if constexpr (Has(kMask, Trait::kQuadrics)) {
      if (emitter < impl.first_disk()) {
        const SphereView view = View(impl.spheres[emitter - impl.first_sphere()], p);
        shape_pdf = view.visible ? view.pdf : 0;
      } else {
        shape_pdf = PdfDisk(View(impl.disks[emitter - impl.first_disk()], p), p, wi, p_light);
      }
    }
  }
  const float pdf = PdfSolidAngle(shape_pdf, impl.choice.Probability(emitter, p));
  return IsUsablePdf(pdf) ? pdf : 0;
}

Rgb LightTable::EmitterRadiance(uint32_t emitter, Vec3f ng, Vec3f wo) const {
  const bool front = Dot(ng, wo) > 0;
  if (emitter < impl_->first_sphere()) {
    const TriangleEmitter& t = impl_->triangles[emitter];
    return t.two_sided || front ? t.radiance : Rgb{};
  }
  if (emitter < impl_->first_disk()) {
    const SphereEmitter& s = impl_->spheres[emitter - impl_->first_sphere()];
    return s.two_sided || front != s.inward ? s.radiance : Rgb{};
  }
  const DiskEmitter& d = impl_->disks[emitter - impl_->first_disk()];
  return d.two_sided || front ? d.radiance : Rgb{};
}

// Where there are several lights, which one will be asked is not known so early.
LightTable::Preparation LightTable::Prepare(const Impl& impl, Vec2f u) {
  if (!impl.HasOnlyOneMap()) return {};
  return {impl.infinites[0].map->Sample(u)};
}

EnvironmentMap::Place LightTable::LocateInFirst(const Impl& impl, Vec3f d) {
  if (impl.infinites.empty()) return {};
  return PlaceOf(impl.infinites[0], d);
}

Rgb LightTable::RadianceFromInfinity(const Impl& impl, Vec3f d) {
  Rgb sum;
  for (const InfiniteEmitter& light : impl.infinites) sum += RadianceAt(light, PlaceOf(light, d));
  return sum;
}

EnvironmentValue LightTable::FromInfinity(const Impl& impl, Vec3f p, Vec3f /*n*/, Vec3f d,
                                          uint32_t located, EnvironmentMap::Place place) {
  EnvironmentValue value;
  for (uint32_t i = 0; i < impl.infinites.size(); ++i) {
    const InfiniteEmitter& light = impl.infinites[i];
    const EnvironmentMap::Place here = i == located ? place : PlaceOf(light, d);
    value.radiance += RadianceAt(light, here);
    value.pdf +=
        PdfSolidAngle(PdfAt(light, here), impl.choice.Probability(impl.first_infinite() + i, p));
  }
  return value;
}

// The header forwards to these: one instantiation for every combination of kLightTraits.
#define SHEAF_INSTANTIATE_FOR(mask)                                                           \
  template std::optional<LightSample> LightTable::SampleLights<(mask)>(                       \
      const Impl&, Vec3f, Vec3f, float, Vec2f, const Preparation&);                           \
  template float LightTable::PdfOfEmitter<(mask)>(const Impl&, uint32_t, Vec3f, Vec3f, Vec3f, \
                                                  Vec3f);
#define SHEAF_INSTANTIATE_WITH(mask)                                          \
  SHEAF_INSTANTIATE_FOR(mask)                                                 \
  SHEAF_INSTANTIATE_FOR((mask) | static_cast<uint32_t>(Trait::kEnvironment))  \
  SHEAF_INSTANTIATE_FOR((mask) | static_cast<uint32_t>(Trait::kDeltaLights))  \
  SHEAF_INSTANTIATE_FOR((mask) | static_cast<uint32_t>(Trait::kEnvironment) | \
                        static_cast<uint32_t>(Trait::kDeltaLights))
SHEAF_INSTANTIATE_WITH(0u)
SHEAF_INSTANTIATE_WITH(static_cast<uint32_t>(Trait::kAreaLights))
SHEAF_INSTANTIATE_WITH(static_cast<uint32_t>(Trait::kQuadrics))
SHEAF_INSTANTIATE_WITH(static_cast<uint32_t>(Trait::kAreaLights) |
                       static_cast<uint32_t>(Trait::kQuadrics))
#undef SHEAF_INSTANTIATE_WITH
#undef SHEAF_INSTANTIATE_FOR

}  // namespace sheaf::render
