// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/guiding/guided_emission.h"

#include <algorithm>
#include <cmath>

#include "worker/render/sampling/directions.h"
#include "worker/render/sampling/equal_area_map.h"

namespace sheaf::render {
namespace {

EmissionPlace PlaceBy(const EmissionUniforms& u) {
  return {{static_cast<double>(u.position.x), static_cast<double>(u.position.y),
           static_cast<double>(u.direction.x), static_cast<double>(u.direction.y)}};
}

// The number in [0, 1) that remains of v, of which the field takes the upper part.
double Rescaled(double v, bool is_guided) {
  const double rest =
      is_guided ? (v - kUnguidedEmission) / (1 - kUnguidedEmission) : v / kUnguidedEmission;
  return std::clamp(rest, 0.0, kPlaceMost);
}

}  // namespace

uint32_t GuidedEmission::LightOf(const EmissionField::Cell& cell, double v) const {
  if (cell.last - cell.first == 1) return cell.first;
  const double begin = emission_->ChoiceBegin(cell.first);
  const double choice = std::min(begin + v * ChoiceOf(cell), kPlaceMost);
  return std::clamp(emission_->Choose(choice), cell.first, cell.last - 1);
}

template <typename Color>
std::optional<EmittedRayOf<Color>> GuidedEmission::SampleLe(
    const EmissionUniforms& u, const WavelengthsOf<Color>& wavelengths) const {
  if (field_ == nullptr) return emission_->SampleLe<Color>(u, wavelengths);
  double choice = LightEmission::ChoiceOf(u);
  const bool is_guided = choice >= kUnguidedEmission;
  choice = Rescaled(choice, is_guided);
  if (!is_guided) {
    auto ray = emission_->SampleLeOf<Color>(choice, u, wavelengths);
    if (ray) {
      const EmissionOrigin origin = OriginOf(ray->light, ray->p, ray->p, ray->n, ray->w);
      const double guided = (1 - kUnguidedEmission) / kUnguidedEmission;
      const auto cell = field_->CellOf(origin.light, origin.place);
      // The ray's own pdf: a portal's could be 0 at the start of its ray.
      ray->pdf *= kUnguidedEmission * (1 + guided * cell.density / (ChoiceOf(cell) * origin.own));
      if (!std::isfinite(ray->pdf)) return std::nullopt;
    }
    return ray;
  }
  const EmissionField::Cell cell = field_->Sample(&choice);
  const uint32_t light = LightOf(cell, choice);
  if (light == emission_->light_count()) return std::nullopt;
  auto ray = emission_->RayAt<Color>(light, cell.PlaceAt(PlaceBy(u)), wavelengths);
  if (!ray) return std::nullopt;
  const EmissionOrigin origin = OriginOf(light, ray->p, ray->p, ray->n, ray->w);
  ray->pdf *= ChoiceOf(light) * Mixed(origin.own, cell);
  return ray->pdf > 0 && std::isfinite(ray->pdf) ? ray : std::nullopt;
}
template std::optional<EmittedRayOf<Rgb>> GuidedEmission::SampleLe<Rgb>(const EmissionUniforms&,
                                                                        const NoWavelengths&) const;
template std::optional<EmittedRayOf<Spectral>> GuidedEmission::SampleLe<Spectral>(
    const EmissionUniforms&, const Wavelengths&) const;

std::optional<GuidedEmission::MediaStart> GuidedEmission::StartInMedia(
    const EmissionUniforms& u) const {
  double choice = LightEmission::ChoiceOf(u);
  if (field_ == nullptr) {
    const std::optional<double> media = emission_->ChooseMedia(choice);
    if (!media) return std::nullopt;
    return MediaStart{*media, UniformDirection(u.direction), emission_->media_probability()};
  }
  if (emission_->media_probability() == 0) return std::nullopt;
  const bool is_guided = choice >= kUnguidedEmission;
  choice = Rescaled(choice, is_guided);
  MediaStart start;
  if (is_guided) {
    const EmissionField::Cell cell = field_->Sample(&choice);
    if (LightOf(cell, choice) != media()) return std::nullopt;
    if (cell.last - cell.first > 1) {
      const double begin = emission_->ChoiceBegin(cell.first);
      const std::optional<double> rest =
          emission_->ChooseMedia(std::min(begin + choice * ChoiceOf(cell), kPlaceMost));
      if (!rest) return std::nullopt;
      choice = *rest;
    }
    start.w = ToFloat(EqualAreaSquareToSphere(cell.PlaceAt(PlaceBy(u)).direction()));
    start.probability = ChoiceOf(media()) * Mixed(1, cell);
  } else {
    const std::optional<double> rest = emission_->ChooseMedia(choice);
    if (!rest) return std::nullopt;
    choice = *rest;
    start.w = UniformDirection(u.direction);
    start.probability = MediaProbability(start.w);
  }
  start.choice = choice;
  return start;
}

double GuidedEmission::MediaProbability(Vec3f w) const {
  const double own = emission_->media_probability();
  if (field_ == nullptr || own == 0) return own;
  return own * DensityOf(OriginOf(media(), {}, {}, {}, w));
}

EmissionOrigin GuidedEmission::OriginOf(uint32_t light, Vec3f p, Vec3f p_light, Vec3f n,
                                        Vec3f w) const {
  EmissionOrigin origin{light, emission_->PlaceOfRay(light, p, p_light, n, w), 1};
  origin.own = emission_->OwnDensity(light, w);
  return origin;
}

double GuidedEmission::PdfLe(uint32_t light, Vec3f p, Vec3f p_light, Vec3f n, Vec3f w) const {
  const double own = emission_->PdfLe(light, p, n, w);
  if (field_ == nullptr || !(own > 0)) return own;
  const EmissionOrigin origin = OriginOf(light, p, p_light, n, w);
  return own * (DensityOf(origin) / origin.own);
}

double GuidedEmission::DensityAt(uint32_t light, Vec3f p, Vec3f p_light, Vec3f n, Vec3f w) const {
  const double own = emission_->DensityAt(light, p, p_light, n, w);
  if (field_ == nullptr || !(own > 0)) return own;
  const EmissionOrigin origin = OriginOf(light, p, p_light, n, w);
  return own * (DensityOf(origin) / origin.own);
}

double GuidedEmission::InfiniteDensityAt(Vec3f p, Vec3f w) const {
  if (field_ == nullptr) return emission_->InfiniteDensityAt(p, w);
  double sum = 0;
  for (uint32_t light = emission_->first_infinite(); light < emission_->light_count(); ++light) {
    sum += PdfLe(light, p, {}, {}, w);
  }
  return sum;
}

}  // namespace sheaf::render
