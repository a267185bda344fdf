// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/light_emission.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#include "common/base/vector_bytes.h"
#include "common/math/elementary.h"
#include "common/math/frame.h"
#include "worker/render/light/area_light_sampling.h"
#include "worker/render/light/light_radiance.h"
#include "worker/render/sampling/directions.h"

namespace sheaf::render {
namespace {

// Relative slack of the sphere, so that rounding moves no ray's start into it.
constexpr double kRadiusSlack = 0x1p-20;

// --- Surfaces ----------------------------------------------------------------------------------

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

bool IsUsable(double pdf) { return pdf > 0 && std::isfinite(pdf); }

}  // namespace

LightEmission::LightEmission(const LightTable& lights, Vec3d center, double radius,
                             double media_power)
    : lights_(&lights), center_(center), radius_(radius * (1 + kRadiusSlack)) {
  const LightTable::Impl& impl = lights.impl();
  for (const IntensityDistribution& distribution : impl.light_maps.intensities) {
    if (const auto* map = std::get_if<IntensityMap>(&distribution)) {
      samplers_.intensities.emplace_back(MapDirections(*map));
    } else {
      samplers_.intensities.emplace_back(WebDirections(std::get<PhotometricWeb>(distribution)));
    }
  }
  for (const ProjectedImage& image : impl.light_maps.projected) {
    samplers_.projected.emplace_back(image);
  }
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
  uint64_t bytes = VectorBytes(samplers_.intensities, samplers_.projected) + choice_.size_bytes();
  for (const auto& directions : samplers_.intensities) {
    bytes += std::visit([](const auto& d) { return d.memory_bytes(); }, directions);
  }
  for (const ImageDirections& directions : samplers_.projected) {
    bytes += directions.memory_bytes();
  }
  return bytes;
}

// --- Power -------------------------------------------------------------------------------------

double LightEmission::CrossSection() const { return kPi * radius_ * radius_; }

double LightEmission::PowerOf(uint32_t light) const {
  const LightTable::Impl& impl = lights_->impl();
  return impl.Visit(light,
                    [&](const auto& kind) { return kind.Power(impl.light_maps, CrossSection()); });
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
  impl.VisitSurface(light, [&](const auto& emitter) {
    point = AreaSample(emitter.SampleArea(u.position),
                       impl.ColorOfEmission(emitter.radiance, wavelengths));
    ray->w = EmittedDirection(point.n_light, emitter.IsInward(), emitter.two_sided, u.direction);
  });
  BeginAt<Color>(impl, light, wavelengths, point, ray);
  ray->pdf = PdfLe(light, {}, ray->n, ray->w);
}

template <typename Color>
void LightEmission::SampleDelta(uint32_t light, const EmissionUniforms& u,
                                const WavelengthsOf<Color>& wavelengths,
                                EmittedRayOf<Color>* ray) const {
  const LightTable::Impl& impl = lights_->impl();
  impl.VisitDelta(light, [&](const auto& delta) {
    if constexpr (std::decay_t<decltype(delta)>::kIsDistant) {
      ray->w = -delta.to_light;
      ray->p = StartBefore(PointOnDisk(ray->w, u.position), ray->w);
      ray->power = impl.ColorOfEmission(delta.emission, wavelengths);
      ray->is_infinite = true;
    } else {
      ray->w = ToFloat(Normalize(delta.SampleDirection(samplers_, u.direction)));
      ray->p = ToFloat(delta.position);
      ray->power = IntensityAlong<Color>(impl, delta, ray->w, wavelengths);
    }
  });
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
    place = light.PlaceOf(through.d);
  } else {
    double direction_pdf = 1 / (4 * kPi);
    if (light.map) {
      const EnvironmentMap::PlaceSample sample = light.map->Sample(u.direction);
      place = sample.place;
      direction_pdf = static_cast<double>(sample.pdf);
      ray->w = -light.DirectionOf(place);
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
    SampleDelta<Color>(ray.light, u, wavelengths, &ray);
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
    return impl.VisitDelta(light, [&](const auto& delta) {
      if constexpr (std::decay_t<decltype(delta)>::kIsDistant) {
        return probability / CrossSection();
      } else {
        return probability * delta.DirectionPdf(samplers_, w);
      }
    });
  }
  const InfiniteEmitter& infinite = impl.infinites[light - impl.first_infinite()];
  if (infinite.portal) return probability * infinite.portal->PdfRay(p, -w);
  return probability * infinite.Pdf(infinite.PlaceOf(-w)) / CrossSection();
}

double LightEmission::SurfaceDensity(uint32_t light, double cosine) const {
  return lights_->impl().VisitSurface(light, [&](const auto& emitter) {
    const double per_side = choice_.Probability(light) / (kPi * emitter.Area());
    if (emitter.two_sided) return 0.5 * per_side;
    return (emitter.IsInward() ? cosine < 0 : cosine > 0) ? per_side : 0;
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
  const LightTable::Impl& impl = lights_->impl();
  if (IsInfinite(light) || IsDistant(impl.deltas[light - impl.first_delta()])) return pdf;
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
