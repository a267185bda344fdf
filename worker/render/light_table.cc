// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Sampling and evaluating lights. light_table_build.cc makes them from the scene.
#include "worker/render/light_table.h"

#include <cmath>
#include <variant>

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

// Without its pdf.
template <typename Color>
LightSampleOf<Color> AreaSample(const ShapePoint& point, const Color& radiance) {
  LightSampleOf<Color> sample;
  sample.wi = ToFloat(point.wi);
  sample.p_light = ToFloat(point.p);
  sample.p_light_error = RoundingErrorOf(sample.p_light);
  sample.n_light = ToFloat(point.n);
  sample.radiance = radiance;
  return sample;
}

DiskShapeView View(const DiskEmitter& disk, Vec3f p) {
  return ViewDisk(disk.center, disk.normal, disk.axis_x, disk.radius, disk.inner_radius, p);
}
TriangleView View(const TriangleEmitter& t, Vec3f p) { return ViewTriangle(t.v0, t.v1, t.v2, p); }
SphereView View(const SphereEmitter& s, Vec3f p) {
  return ViewSphere(s.center, s.radius, s.inward && !s.two_sided, p);
}

template <typename Color>
std::optional<LightSampleOf<Color>> Sample(const TriangleEmitter& t, const Color& radiance,
                                           float probability, Vec3f p, Vec2f u) {
  const TriangleView view = View(t, p);
  if (!view.visible || !(view.front() || t.two_sided)) return std::nullopt;
  const ShapePoint point = SampleTriangle(view, t.v0, p, u);
  LightSampleOf<Color> sample = AreaSample(point, radiance);
  sample.pdf = PdfSolidAngle(PdfTriangle(view, p, sample.p_light), probability);
  return sample;
}

template <typename Color>
std::optional<LightSampleOf<Color>> Sample(const SphereEmitter& s, const Color& radiance,
                                           float probability, Vec3f p, Vec2f u) {
  const SphereView view = View(s, p);
  if (!view.visible || !(s.two_sided || view.inside == s.inward)) return std::nullopt;
  LightSampleOf<Color> sample = AreaSample(SampleSphere(view, s.center, s.radius, u), radiance);
  sample.pdf = PdfSolidAngle(view.pdf, probability);
  return sample;
}

template <typename Color>
std::optional<LightSampleOf<Color>> Sample(const DiskEmitter& d, const Color& radiance,
                                           float probability, Vec3f p, Vec2f u) {
  const DiskShapeView view = View(d, p);
  if (!view.visible || !(view.front() || d.two_sided)) return std::nullopt;
  bool hit = false;
  const ShapePoint point = SampleDisk(view, p, u, &hit);
  if (!hit) return std::nullopt;
  LightSampleOf<Color> sample = AreaSample(point, radiance);
  sample.pdf = PdfSolidAngle(PdfDisk(view, p, sample.wi, sample.p_light), probability);
  return sample;
}

// Where a point of an emitter reads its picture or cut-out.
Vec2f UvOnTriangle(const TriangleEmitter& t, const EmissionDetail& detail, Vec3f p) {
  const Vec3d v0 = ToDouble(t.v0), e1 = ToDouble(t.v1) - v0, e2 = ToDouble(t.v2) - v0;
  const Vec3d normal = Cross(e1, e2), d = ToDouble(p) - v0;
  const double square = LengthSquared(normal);
  const auto b1 = static_cast<float>(Dot(Cross(d, e2), normal) / square);
  const auto b2 = static_cast<float>(Dot(Cross(e1, d), normal) / square);
  return detail.uv[0] + b1 * (detail.uv[1] - detail.uv[0]) + b2 * (detail.uv[2] - detail.uv[0]);
}
Vec2f UvOnQuadric(const Quadric& quadric, Vec3f p) {
  return QuadricParametersAt(quadric, quadric.object_from_target.Point(ToDouble(p))).uv;
}

template <typename Color>
Color RadianceOfMap(const LightTable::Impl& impl, const EmissionDetail& detail, Vec2f uv,
                    const WavelengthsOf<Color>& wavelengths) {
  const Rgb seen = impl.maps[static_cast<size_t>(detail.map)]->At(uv);
  return ColorOfRgb<Color>(seen * detail.map_scale, ColorRole::kIlluminant, wavelengths);
}

// Makes a sample of an emitter that of the point it found.
template <typename Color>
void AddDetail(const LightTable::Impl& impl, uint32_t emitter,
               const WavelengthsOf<Color>& wavelengths, LightSampleOf<Color>* sample) {
  const EmissionDetail* detail = impl.DetailOf(emitter);
  if (detail == nullptr) return;
  if (detail->quadric != kNone) {
    sample->uv = UvOnQuadric(impl.quadrics[static_cast<size_t>(detail->quadric)], sample->p_light);
  } else {
    // A part of a triangle may lie off it by the rounding of the part's own corners.
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

// What the light, which has a place, sends along the (unit) direction w that leaves it.
template <typename Color>
Color IntensityAlong(const LightTable::Impl& impl, const DeltaLight& light, Vec3f w,
                     const WavelengthsOf<Color>& wavelengths) {
  if (light.kind == DeltaLight::Kind::kProjection) {
    const Rgb seen = impl.projected_images[light.picture].At(Rotate(light.light_from_render, w));
    return ColorOfRgb<Color>(seen * light.emission.rgb, ColorRole::kIlluminant, wavelengths);
  }
  return impl.ColorOfEmission(light.emission, wavelengths) * FalloffAlong(impl, light, w);
}

template <typename Color>
std::optional<LightSampleOf<Color>> Sample(const LightTable::Impl& impl, const DeltaLight& light,
                                           const WavelengthsOf<Color>& wavelengths,
                                           float probability, Vec3f p) {
  LightSampleOf<Color> sample;
  sample.is_delta = true;
  sample.pdf = probability;
  if (light.kind == DeltaLight::Kind::kDistant) {
    sample.wi = light.to_light;
    sample.radiance = impl.ColorOfEmission(light.emission, wavelengths);
    sample.is_infinite = true;
    return sample;
  }
  const Vec3d to_light = light.position - ToDouble(p);
  const double d_squared = LengthSquared(to_light);
  if (!(d_squared > 0)) return std::nullopt;
  sample.wi = ToFloat(to_light / std::sqrt(d_squared));
  sample.p_light = ToFloat(light.position);
  sample.p_light_error = RoundingErrorOf(sample.p_light);
  sample.radiance = IntensityAlong<Color>(impl, light, -sample.wi, wavelengths) *
                    static_cast<float>(1 / d_squared);
  return sample;
}

EnvironmentMap::Place PlaceOf(const InfiniteEmitter& light, Vec3f d) {
  if (!light.map) return {};
  return light.map->Locate(Rotate(light.light_from_render, d));
}

// place: of the direction, where there is a map.
template <typename Color>
Color RadianceAt(const LightTable::Impl& impl, const InfiniteEmitter& light,
                 EnvironmentMap::Place place, const WavelengthsOf<Color>& wavelengths) {
  if (!light.map) return impl.ColorOfEmission(light.radiance, wavelengths);
  const Rgb radiance = light.map->Radiance(place) * light.scale;
  return ColorOfRgb<Color>(radiance, ColorRole::kIlluminant, wavelengths);
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

float FalloffAlong(const LightTable::Impl& impl, const DeltaLight& light, Vec3f w) {
  if (light.kind == DeltaLight::Kind::kPoint) return 1;
  const Vec3f w_light = Rotate(light.light_from_render, w);
  if (light.kind == DeltaLight::Kind::kGoniometric) {
    return std::visit(
        [&](const auto& intensity) { return intensity.At(w_light / Length(w_light)); },
        impl.intensities[light.picture]);
  }
  const float cosine = Dot(w_light, light.axis) / Length(w_light);
  return SmoothStep(cosine, light.cos_end, light.cos_start);
}

LightTable::LightTable() = default;
LightTable::~LightTable() = default;

bool LightTable::empty() const { return impl_->empty; }

template <uint32_t kMask>
std::optional<LightSampleOf<ColorOf<kMask>>> LightTable::SampleLights(
    const Impl& impl, Vec3f p, Vec3f n, float u_select, Vec2f u,
    const WavelengthsOf<ColorOf<kMask>>& wavelengths, const Preparation& preparation) {
  using Color = ColorOf<kMask>;
  if (impl.empty) return std::nullopt;
  const std::optional<ChosenLight> chosen = impl.choice.Choose(p, n, u_select, SaltOf(u));
  if (!chosen) return std::nullopt;
  const uint32_t light = chosen->light;
  std::optional<LightSampleOf<Color>> sample;
  const auto sample_area = [&](const auto& emitter) {
    const Color radiance = impl.ColorOfEmission(emitter.radiance, wavelengths);
    sample = render::Sample(emitter, radiance, chosen->probability, p, u);
    if constexpr (Has(kMask, Trait::kVaryingEmission)) {
      if (sample) AddDetail<Color>(impl, light, wavelengths, &*sample);
    }
  };
  if (light < impl.first_delta()) {
    if constexpr (Has(kMask, Trait::kAreaLights)) {
      if (light < impl.first_sphere()) {
        sample_area(impl.triangles[light]);
      } else if constexpr (Has(kMask, Trait::kQuadrics)) {
        if (light < impl.first_disk()) {
          sample_area(impl.spheres[light - impl.first_sphere()]);
        } else {
          sample_area(impl.disks[light - impl.first_disk()]);
        }
      }
    }
  } else if (light < impl.first_infinite()) {
    if constexpr (Has(kMask, Trait::kDeltaLights)) {
      const DeltaLight& delta = impl.deltas[light - impl.first_delta()];
      sample = render::Sample<Color>(impl, delta, wavelengths, chosen->probability, p);
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
      sample->radiance = RadianceAt<Color>(impl, infinite, place, wavelengths);
      sample->pdf = preparation.sky.pdf;
    } else {
      const EnvironmentValueOf<Color> value =
          FromInfinity<Color>(impl, p, n, sample->wi, wavelengths, index, place);
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
float LightTable::PdfOfEmitter(const Impl& impl, uint32_t emitter, Vec3f p, Vec3f n, Vec3f wi,
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
  const float pdf = PdfSolidAngle(shape_pdf, impl.choice.Probability(emitter, p, n));
  return IsUsablePdf(pdf) ? pdf : 0;
}

template <typename Color>
Color LightTable::EmitterRadiance(uint32_t emitter, Vec3f ng, Vec3f wo,
                                  const WavelengthsOf<Color>& wavelengths) const {
  const bool front = Dot(ng, wo) > 0;
  const auto radiance = [&](const auto& e, bool emits) {
    return e.two_sided || emits ? impl_->ColorOfEmission(e.radiance, wavelengths) : Color{};
  };
  if (emitter < impl_->first_sphere()) return radiance(impl_->triangles[emitter], front);
  if (emitter < impl_->first_disk()) {
    const SphereEmitter& s = impl_->spheres[emitter - impl_->first_sphere()];
    return radiance(s, front != s.inward);
  }
  return radiance(impl_->disks[emitter - impl_->first_disk()], front);
}
template Rgb LightTable::EmitterRadiance<Rgb>(uint32_t, Vec3f, Vec3f, const NoWavelengths&) const;
template Spectral LightTable::EmitterRadiance<Spectral>(uint32_t, Vec3f, Vec3f,
                                                        const Wavelengths&) const;

template <typename Color>
Color LightTable::VaryingRadiance(uint32_t emitter, Vec3f ng, Vec3f wo, Vec2f uv,
                                  const WavelengthsOf<Color>& wavelengths) const {
  const Color radiance = EmitterRadiance<Color>(emitter, ng, wo, wavelengths);
  const EmissionDetail* detail = impl_->DetailOf(emitter);
  if (detail == nullptr || detail->map == kNone || radiance.IsBlack()) return radiance;
  return RadianceOfMap<Color>(*impl_, *detail, uv, wavelengths);
}
template Rgb LightTable::VaryingRadiance<Rgb>(uint32_t, Vec3f, Vec3f, Vec2f,
                                              const NoWavelengths&) const;
template Spectral LightTable::VaryingRadiance<Spectral>(uint32_t, Vec3f, Vec3f, Vec2f,
                                                        const Wavelengths&) const;

// Where there are several lights, which one will be asked is not known so early.
LightTable::Preparation LightTable::Prepare(const Impl& impl, Vec2f u) {
  if (!impl.HasOnlyOneMap()) return {};
  return {impl.infinites[0].map->Sample(u)};
}

EnvironmentMap::Place LightTable::LocateInFirst(const Impl& impl, Vec3f d) {
  if (impl.infinites.empty()) return {};
  return PlaceOf(impl.infinites[0], d);
}

template <typename Color>
Color LightTable::RadianceFromInfinity(const Impl& impl, Vec3f d,
                                       const WavelengthsOf<Color>& wavelengths) {
  Color sum;
  for (const InfiniteEmitter& light : impl.infinites) {
    sum += RadianceAt<Color>(impl, light, PlaceOf(light, d), wavelengths);
  }
  return sum;
}

template <typename Color>
EnvironmentValueOf<Color> LightTable::FromInfinity(const Impl& impl, Vec3f p, Vec3f n, Vec3f d,
                                                   const WavelengthsOf<Color>& wavelengths,
                                                   uint32_t located, EnvironmentMap::Place place) {
  EnvironmentValueOf<Color> value;
  for (uint32_t i = 0; i < impl.infinites.size(); ++i) {
    const InfiniteEmitter& light = impl.infinites[i];
    const EnvironmentMap::Place here = i == located ? place : PlaceOf(light, d);
    value.radiance += RadianceAt<Color>(impl, light, here, wavelengths);
    value.pdf +=
        PdfSolidAngle(PdfAt(light, here), impl.choice.Probability(impl.first_infinite() + i, p, n));
  }
  return value;
}

// The header forwards to these: one instantiation for every combination of kLightTraits.
#define SHEAF_INSTANTIATE_FOR(mask) \
  SHEAF_INSTANTIATE_IN_COLOR(mask)  \
  SHEAF_INSTANTIATE_IN_COLOR((mask) | static_cast<uint32_t>(Trait::kSpectral))
#define SHEAF_INSTANTIATE_IN_COLOR(mask)                                                      \
  template std::optional<LightSampleOf<ColorOf<(mask)>>> LightTable::SampleLights<(mask)>(    \
      const Impl&, Vec3f, Vec3f, float, Vec2f, const WavelengthsOf<ColorOf<(mask)>>&,         \
      const Preparation&);                                                                    \
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
// Emission that varies is rare: variants that know it know every kind of light.
SHEAF_INSTANTIATE_FOR(LightTable::kLightTraits & ~static_cast<uint32_t>(Trait::kSpectral))
#undef SHEAF_INSTANTIATE_WITH
#undef SHEAF_INSTANTIATE_FOR
#undef SHEAF_INSTANTIATE_IN_COLOR

#define SHEAF_INSTANTIATE_INFINITY(color)                                              \
  template color LightTable::RadianceFromInfinity<color>(const Impl&, Vec3f,           \
                                                         const WavelengthsOf<color>&); \
  template EnvironmentValueOf<color> LightTable::FromInfinity<color>(                  \
      const Impl&, Vec3f, Vec3f, Vec3f, const WavelengthsOf<color>&, uint32_t,         \
      EnvironmentMap::Place);
SHEAF_INSTANTIATE_INFINITY(Rgb)
SHEAF_INSTANTIATE_INFINITY(Spectral)
#undef SHEAF_INSTANTIATE_INFINITY

}  // namespace sheaf::render
