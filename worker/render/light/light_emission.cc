// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/light_emission.h"

#include <algorithm>
#include <cmath>

#include "common/base/vector_bytes.h"
#include "common/math/elementary.h"
#include "common/math/frame.h"
#include "worker/render/geometry/affine.h"
#include "worker/render/light/area_light_sampling.h"
#include "worker/render/light/emitter_shapes.h"
#include "worker/render/light/light_radiance.h"

namespace sheaf::render {
namespace {

// Relative slack of the sphere, so that rounding moves no ray's start into it.
constexpr double kRadiusSlack = 0x1p-20;

// --- Surfaces ----------------------------------------------------------------------------------

// Uniform by area. wi is unused.
ShapePoint SampleArea(const TriangleEmitter& t, Vec2f u) {
  const Vec3d v0 = ToDouble(t.v0), e1 = ToDouble(t.v1) - v0, e2 = ToDouble(t.v2) - v0;
  const double root = std::sqrt(static_cast<double>(u.x));
  const double b2 = static_cast<double>(u.y) * root;
  return {{}, v0 + (root - b2) * e1 + b2 * e2, Normalize(Cross(e1, e2))};
}
ShapePoint SampleArea(const SphereEmitter& s, Vec2f u) {
  const Vec3d n = Normalize(ToDouble(UniformDirection(u)));
  return {{}, s.center + s.radius * n, n};
}
ShapePoint SampleArea(const DiskEmitter& d, Vec2f u) {
  const double inner_squared = d.inner_radius * d.inner_radius;
  const double r =
      std::sqrt(inner_squared + static_cast<double>(u.x) * (d.radius * d.radius - inner_squared));
  const SinCosPair<double> phi = SinCos(2 * kPi * static_cast<double>(u.y));
  return {{},
          d.center + (r * phi.cos) * d.axis_x + (r * phi.sin) * Cross(d.normal, d.axis_x),
          d.normal};
}

// By the cosine with n. Source: Malley's method, Pharr, Jakob and Humphreys, sec. 13.6.3.
Vec3f CosineDirection(Vec3f n, Vec2d u) {
  const Frame frame = Frame::FromNormal(n);
  const double sine = std::sqrt(u.x), cosine = std::sqrt(1 - u.x);
  const SinCosPair<double> phi = SinCos(2 * kPi * u.y);
  return ToFloat(Normalize((sine * phi.cos) * ToDouble(frame.t) +
                           (sine * phi.sin) * ToDouble(frame.b) + cosine * ToDouble(n)));
}

// On the side on which the emitter emits; on either where it is two-sided.
Vec3f EmittedDirection(Vec3f n, bool inward, bool two_sided, Vec2f u) {
  Vec2d v{static_cast<double>(u.x), static_cast<double>(u.y)};
  bool below = inward;
  if (two_sided) {
    below = v.x >= 0.5;
    v.x = below ? 2 * v.x - 1 : 2 * v.x;
  }
  return CosineDirection(below ? -n : n, v);
}

// --- Lights without a surface ------------------------------------------------------------------

Affine LightFromRender(const DeltaLight& light) {
  const Vec3d x = ToDouble(light.light_from_render[0]), y = ToDouble(light.light_from_render[1]),
              z = ToDouble(light.light_from_render[2]);
  return {{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}, {}};
}

bool IsUsable(double pdf) { return pdf > 0 && std::isfinite(pdf); }

double LuminanceOf(Rgb color) { return static_cast<double>(StrengthOf(color)); }

}  // namespace

LightEmission::LightEmission(const LightTable& lights, Vec3d center, double radius,
                             double media_power)
    : lights_(&lights), center_(center), radius_(radius * (1 + kRadiusSlack)) {
  const LightTable::Impl& impl = lights.impl();
  for (const IntensityDistribution& distribution : impl.intensities) {
    if (const auto* map = std::get_if<IntensityMap>(&distribution)) {
      intensities_.emplace_back(MapDirections(*map));
    } else {
      intensities_.emplace_back(WebDirections(std::get<PhotometricWeb>(distribution)));
    }
  }
  for (const ProjectedImage& image : impl.projected_images) images_.emplace_back(image);
  std::vector<double> powers(lights.light_count());
  for (uint32_t light = 0; light < powers.size(); ++light) {
    const double power = PowerOf(light);
    powers[light] = std::isfinite(power) ? power : 0;
    power_ += powers[light];
  }
  if (media_power > 0 && std::isfinite(media_power)) {
    powers.push_back(media_power);
    power_ += media_power;
  }
  choice_ = DiscreteDistribution(powers);
  if (powers.size() > lights.light_count()) {
    media_probability_ = choice_.Probability(lights.light_count());
  }
}

uint64_t LightEmission::memory_bytes() const {
  uint64_t bytes = VectorBytes(intensities_, images_) + choice_.size_bytes();
  for (const auto& directions : intensities_) {
    bytes += std::visit([](const auto& d) { return d.memory_bytes(); }, directions);
  }
  for (const ImageDirections& directions : images_) bytes += directions.memory_bytes();
  return bytes;
}

// --- Power -------------------------------------------------------------------------------------

double LightEmission::CrossSection() const { return kPi * radius_ * radius_; }

double LightEmission::PowerOf(uint32_t light) const {
  const LightTable::Impl& impl = lights_->impl();
  if (light < impl.first_delta()) {
    return WithEmitter(impl, light, [](const auto& emitter) {
      const double area = AreaOf(emitter);
      const double sides = emitter.two_sided ? 2 : 1;
      return area > 0 ? kPi * area * sides * LuminanceOf(emitter.radiance.rgb) : 0.0;
    });
  }
  if (light < impl.first_infinite()) return PowerOf(impl.deltas[light - impl.first_delta()]);
  return PowerOf(impl.infinites[light - impl.first_infinite()]);
}

double LightEmission::PowerOf(const DeltaLight& light) const {
  const LightTable::Impl& impl = lights_->impl();
  const double strength = LuminanceOf(light.emission.rgb);
  switch (light.kind) {
    case DeltaLight::Kind::kPoint:
      return 4 * kPi * strength;
    case DeltaLight::Kind::kSpot:
      return SpotOf(light).Integral() * strength;
    case DeltaLight::Kind::kDistant:
      return CrossSection() * strength;
    case DeltaLight::Kind::kGoniometric:
      return 4 * kPi * strength *
             std::visit([](const auto& d) { return d.mean(); }, impl.intensities[light.image]);
    case DeltaLight::Kind::kProjection:
      return impl.projected_images[light.image].Power() * strength;
  }
  return 0;
}

double LightEmission::PowerOf(const InfiniteEmitter& light) const {
  const double mean =
      light.map ? light.map->mean_luminance() * static_cast<double>(std::fabs(light.scale))
                : LuminanceOf(light.radiance.rgb);
  if (light.portal) return kPi * light.portal->Area() * mean;
  return 4 * kPi * CrossSection() * mean;
}

// --- Directions --------------------------------------------------------------------------------

SpotDirections LightEmission::SpotOf(const DeltaLight& light) const {
  return SpotDirections(light.axis, light.cos_start, light.cos_end);
}

Vec3d LightEmission::DirectionFrom(const DeltaLight& light, Vec2f u) const {
  switch (light.kind) {
    case DeltaLight::Kind::kSpot:
      return SpotOf(light).Sample(u);
    case DeltaLight::Kind::kGoniometric:
      return std::visit([&](const auto& d) { return d.Sample(u); }, intensities_[light.image]);
    case DeltaLight::Kind::kProjection:
      return images_[light.image].Sample(u);
    default:
      return ToDouble(UniformDirection(u));
  }
}

// A linear map L takes the solid angle about the unit vector w to |det L| / |L w|^3 times that.
double LightEmission::DirectionPdf(const DeltaLight& light, Vec3f w) const {
  if (light.kind == DeltaLight::Kind::kPoint) return 1 / (4 * kPi);
  if (light.kind == DeltaLight::Kind::kDistant) return 1;
  const Affine light_from_render = LightFromRender(light);
  const Vec3d in_light = light_from_render.Vector(ToDouble(w));
  const double length = Length(in_light);
  const double stretch = std::fabs(light_from_render.Determinant()) / (length * length * length);
  if (light.kind == DeltaLight::Kind::kSpot) {
    return stretch * SpotOf(light).Pdf(in_light / length);
  }
  // The vectors by which FalloffAlong and IntensityAlong choose the texel.
  const Vec3f exact = Rotate(light.light_from_render, w);
  if (light.kind == DeltaLight::Kind::kProjection) return stretch * images_[light.image].Pdf(exact);
  return stretch * std::visit([&](const auto& d) { return d.Pdf(exact / Length(exact)); },
                              intensities_[light.image]);
}

// --- Rays --------------------------------------------------------------------------------------

Vec3f LightEmission::StartBefore(Vec3d q, Vec3f w) const {
  const Vec3d along = ToDouble(w);
  const double back = std::max(0.0, Dot(q - center_, along) + radius_);
  return ToFloat(q - back * along);
}

Vec3d LightEmission::PointOnDisk(Vec3f w, Vec2f u) const {
  const Frame frame = Frame::FromNormal(w);
  const double r = radius_ * std::sqrt(static_cast<double>(u.x));
  const SinCosPair<double> phi = SinCos(2 * kPi * static_cast<double>(u.y));
  return center_ + (r * phi.cos) * ToDouble(frame.t) + (r * phi.sin) * ToDouble(frame.b);
}

template <typename Color>
void LightEmission::SampleSurface(uint32_t light, const EmissionUniforms& u,
                                  const WavelengthsOf<Color>& wavelengths,
                                  EmittedRayOf<Color>* ray) const {
  const LightTable::Impl& impl = lights_->impl();
  LightSampleOf<Color> point;
  WithEmitter(impl, light, [&](const auto& emitter) {
    point = AreaSample(SampleArea(emitter, u.position),
                       impl.ColorOfEmission(emitter.radiance, wavelengths));
    ray->w = EmittedDirection(point.n_light, IsInward(emitter), emitter.two_sided, u.direction);
  });
  AddDetail<Color>(impl, light, wavelengths, &point);
  ray->p = point.p_light;
  ray->p_error = point.p_light_error;
  ray->n = point.n_light;
  ray->power = point.radiance * std::fabs(Dot(ray->n, ray->w));
  ray->is_unseen = point.is_delta;
  ray->cut_out = point.cut_out;
  ray->uv = point.uv;
  ray->pdf = PdfLe(light, {}, ray->n, ray->w);
}

template <typename Color>
void LightEmission::SampleDelta(const DeltaLight& light, const EmissionUniforms& u,
                                const WavelengthsOf<Color>& wavelengths,
                                EmittedRayOf<Color>* ray) const {
  const LightTable::Impl& impl = lights_->impl();
  if (light.kind == DeltaLight::Kind::kDistant) {
    ray->w = -light.to_light;
    ray->p = StartBefore(PointOnDisk(ray->w, u.position), ray->w);
    ray->power = impl.ColorOfEmission(light.emission, wavelengths);
    ray->is_infinite = true;
  } else {
    Vec3d w = DirectionFrom(light, u.direction);
    if (light.kind != DeltaLight::Kind::kPoint) w = Inverse(LightFromRender(light)).Vector(w);
    ray->w = ToFloat(Normalize(w));
    ray->p = ToFloat(light.position);
    ray->power = IntensityAlong<Color>(impl, light, ray->w, wavelengths);
  }
  ray->p_error = RoundingErrorOf(ray->p);
  ray->pdf = PdfLe(ray->light, {}, {}, ray->w);
}

template <typename Color>
void LightEmission::SampleInfinite(const InfiniteEmitter& light, double probability,
                                   const EmissionUniforms& u,
                                   const WavelengthsOf<Color>& wavelengths,
                                   EmittedRayOf<Color>* ray) const {
  EnvironmentMap::Place place;
  if (light.portal) {
    const SkyPortal::RaySample through = light.portal->SampleRay(u.direction, u.position);
    ray->w = -through.d;
    ray->p = StartBefore(through.p, ray->w);
    ray->pdf = probability * through.pdf;
    place = PlaceOf(light, through.d);
  } else {
    double direction_pdf = 1 / (4 * kPi);
    if (light.map) {
      const EnvironmentMap::PlaceSample sample = light.map->Sample(u.direction);
      place = sample.place;
      direction_pdf = static_cast<double>(sample.pdf);
      ray->w = -DirectionOf(light, place);
    } else {
      ray->w = UniformDirection(u.direction);
    }
    ray->p = StartBefore(PointOnDisk(ray->w, u.position), ray->w);
    ray->pdf = probability * direction_pdf / CrossSection();
  }
  ray->power = RadianceAt<Color>(lights_->impl(), light, place, wavelengths);
  ray->p_error = RoundingErrorOf(ray->p);
  ray->is_infinite = true;
}

uint32_t LightEmission::light_count() const { return lights_->light_count(); }
uint32_t LightEmission::first_infinite() const { return lights_->impl().first_infinite(); }

uint32_t LightEmission::choice_count() const {
  return lights_->light_count() + (media_probability_ > 0 ? 1 : 0);
}

std::optional<double> LightEmission::MediaChoice(double choice) const {
  const uint32_t media = lights_->light_count();
  if (choice_.Sample(choice) != media) return std::nullopt;
  constexpr double kBelowOne = 1 - 0x1p-53;
  return std::clamp((choice - choice_.Begin(media)) / media_probability_, 0.0, kBelowOne);
}

template <typename Color>
std::optional<EmittedRayOf<Color>> LightEmission::SampleLeOf(
    double choice, const EmissionUniforms& u, const WavelengthsOf<Color>& wavelengths) const {
  const LightTable::Impl& impl = lights_->impl();
  EmittedRayOf<Color> ray;
  ray.light = Choose(choice);
  if (ray.light == lights_->light_count()) return std::nullopt;
  if (ray.light < impl.first_delta()) {
    SampleSurface<Color>(ray.light, u, wavelengths, &ray);
  } else if (ray.light < impl.first_infinite()) {
    SampleDelta<Color>(impl.deltas[ray.light - impl.first_delta()], u, wavelengths, &ray);
  } else {
    SampleInfinite<Color>(impl.infinites[ray.light - impl.first_infinite()],
                          choice_.Probability(ray.light), u, wavelengths, &ray);
  }
  const bool usable = IsUsable(ray.pdf) && IsFinite(ray.power) && !ray.power.IsBlack();
  return usable ? std::optional(ray) : std::nullopt;
}
template std::optional<EmittedRayOf<Rgb>> LightEmission::SampleLeOf<Rgb>(
    double, const EmissionUniforms&, const NoWavelengths&) const;
template std::optional<EmittedRayOf<Spectral>> LightEmission::SampleLeOf<Spectral>(
    double, const EmissionUniforms&, const Wavelengths&) const;

double LightEmission::PdfLe(uint32_t light, Vec3f p, Vec3f n, Vec3f w) const {
  if (empty()) return 0;
  const LightTable::Impl& impl = lights_->impl();
  const double probability = choice_.Probability(light);
  if (!(probability > 0)) return 0;
  if (light < impl.first_delta()) {
    const double cosine = Dot(ToDouble(n), ToDouble(w));
    return SurfaceDensity(light, cosine) * std::fabs(cosine);
  }
  if (light < impl.first_infinite()) {
    const DeltaLight& delta = impl.deltas[light - impl.first_delta()];
    if (delta.kind == DeltaLight::Kind::kDistant) return probability / CrossSection();
    return probability * DirectionPdf(delta, w);
  }
  const InfiniteEmitter& infinite = impl.infinites[light - impl.first_infinite()];
  if (infinite.portal) return probability * infinite.portal->PdfRay(p, -w);
  const double direction_pdf =
      infinite.map ? static_cast<double>(infinite.map->Pdf(PlaceOf(infinite, -w))) : 1 / (4 * kPi);
  return probability * direction_pdf / CrossSection();
}

double LightEmission::SurfaceDensity(uint32_t light, double cosine) const {
  return WithEmitter(lights_->impl(), light, [&](const auto& emitter) {
    const double per_side = choice_.Probability(light) / (kPi * AreaOf(emitter));
    if (emitter.two_sided) return 0.5 * per_side;
    return (IsInward(emitter) ? cosine < 0 : cosine > 0) ? per_side : 0;
  });
}

bool LightEmission::IsInfinite(uint32_t light) const {
  return light >= lights_->impl().first_infinite();
}
bool LightEmission::IsSurface(uint32_t light) const {
  return light < lights_->impl().first_delta();
}

double LightEmission::DensityAt(uint32_t light, Vec3f p, Vec3f p_light, Vec3f n, Vec3f w) const {
  if (empty() || !(choice_.Probability(light) > 0)) return 0;
  if (IsSurface(light)) return SurfaceDensity(light, Dot(ToDouble(n), ToDouble(w)));
  const double pdf = PdfLe(light, p, n, w);
  if (IsInfinite(light) || lights_->impl().deltas[light - lights_->impl().first_delta()].kind ==
                               DeltaLight::Kind::kDistant) {
    return pdf;
  }
  const double d_squared = LengthSquared(ToDouble(p) - ToDouble(p_light));
  return d_squared > 0 ? pdf / d_squared : 0;
}

double LightEmission::InfiniteDensityAt(Vec3f p, Vec3f w) const {
  double sum = 0;
  for (uint32_t light = lights_->impl().first_infinite(); light < lights_->light_count(); ++light) {
    sum += PdfLe(light, p, {}, w);
  }
  return sum;
}

}  // namespace sheaf::render
