// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathTracer, light along lines through media. Included by path_tracer.h. Each segment of a path in
// them gathers light scattered once, from a light chosen for the whole line and at a distance drawn
// by how that light shines along it; that is the third way to a point of a medium and a point of a
// light, beside a flight that ends there followed by a sampled or a met light. The three are
// combined by the power heuristic, over densities of both points. Where media that vary are there
// too, the density of a flight that one of the others ends is taken as if they were not: weights
// need only be the same function of the two points, and of what scatters, for every technique.
// Walks in matter are short and count no depth: they do without lines.
//
// In media that vary no density of flights is known at a point. In place of it stands the
// extinction there, as if all light arrived: with a known transmittance T lines of density p would
// have to be weighed against flights of extinction * T, but theirs is an estimate that is nearly
// always 0 or nearly 1 where the medium is thick, so that it is as if they came there with a
// density of p * T. Where it is thin T is about 1, and the weights those of the true densities.
// Lines gather there only where flights alone are much noise (DistancesOn).
//
// Sources: Kulla and Fajardo 2012; Veach 1997, ch. 9. docs/adr/0024-light-along-lines.md.
#pragma once

#include <algorithm>
#include <array>
#include <optional>

#include "worker/render/integrator/path_tracer.h"

namespace sheaf::render {

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
typename PathTracer<kTraits, Tracer, kDirectLight>::Line
PathTracer<kTraits, Tracer, kDirectLight>::LineOf(const Path& path, double length) const {
  Line line;
  line.o = ToDouble(path.ray.o);
  line.d = Normalize(ToDouble(path.ray.d));
  line.length = length;
  line.carried = path.throughput;
  const MediumMix<Color>& mix = path.media.mix;
  double sigma_t = 0;
  for (size_t i = 0; i < kComponentCount<Color>; ++i) {
    sigma_t += static_cast<double>(mix.sigma_t[i]) / kComponentCount<Color>;
  }
  if constexpr (kVaryingLines) {
    if (mix.gathers) {
      const auto part = scene_.media->PartOfLine(path.media.set, line.o, line.d, length);
      sigma_t += part.extinction;
      if (!mix.scatters) {
        line.begin = part.begin;
        line.length = part.end;
        line.extinction = scene_.media->gathers_always() ? 0 : part.extinction;
      }
      const double middle = line.begin + 0.5 * std::min(line.length - line.begin, 2 / sigma_t);
      line.where_chosen = ToFloat(line.o + middle * line.d);
      return line;
    }
  }
  line.where_chosen = ToFloat(line.o + (0.5 * std::min(length, 2 / sigma_t)) * line.d);
  return line;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
std::optional<EquiangularDistances> PathTracer<kTraits, Tracer, kDirectLight>::DistancesOn(
    const Line& line, uint32_t light) const {
  const LightBounds bounds = scene_.lights->BoundsOf(light);
  if constexpr (kVaryingLines) {
    if (line.extinction > 0 && bounds.kind != LightBounds::Kind::kInfinite &&
        !(SpreadOfFlights(bounds, line.o, line.d, line.begin, line.length, line.extinction) >=
          kSpreadGathered)) {
      return std::nullopt;
    }
    return DistancesTo(bounds, line.o, line.d, line.begin, line.length);
  }
  return DistancesTo(bounds, line.o, line.d, 0, line.length);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::EndLine(const Line& line, double t,
                                                        [[maybe_unused]] Scatterer scatterer,
                                                        Path* path) const {
  const MediumMix<Color>& mix = path->media.mix;
  Line& kept = path->media.line;
  kept = line;
  kept.t = t;
  if constexpr (kVaryingLines) {
    if (scatterer) {
      const MediumTable& media = *scene_.media;
      kept.has_scattered = GathersAlongLines(mix) && media.Gathers(*scatterer);
      if (!kept.has_scattered) return;
      const auto its = media.template CoefficientsAt<Color>(*scatterer, line.o + t * line.d,
                                                            TimeOfMedia<kTraits>(path->ray.time),
                                                            path->wavelengths, mix.form);
      kept.density = MeanExtinction<kChromaticMedia>(its.sigma_t, line.carried);
      return;
    }
  }
  kept.has_scattered = !scatterer && GathersAlongLines(mix);
  kept.density = FlightDensity<kChromaticMedia>(mix, t, line.carried);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
PhaseMix<typename PathTracer<kTraits, Tracer, kDirectLight>::Color>
PathTracer<kTraits, Tracer, kDirectLight>::PhaseOnLine(const Line& line, double t,
                                                       const Path& path) const {
  const MediumMix<Color>& mix = path.media.mix;
  const Color scattered = line.carried * TransmittanceOf<kChromaticMedia>(mix, t) * mix.sigma_s;
  return scene_.media->template PhaseOf<Color>(path.media.set, mix, scattered, path.wavelengths,
                                               path.media.paint.OrNull());
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
double PathTracer<kTraits, Tracer, kDirectLight>::PdfByLine(const Line& line, uint32_t light,
                                                            Vec3f p, double t,
                                                            float pdf_sampled) const {
  const auto distances = DistancesOn(line, light);
  if (!distances) return 0;
  const float chosen_there = scene_.lights->ChoiceProbability(light, p);
  if (!(chosen_there > 0)) return 0;
  const float chosen_for_line = scene_.lights->ChoiceProbability(light, line.where_chosen);
  return static_cast<double>(pdf_sampled) / static_cast<double>(chosen_there) *
         static_cast<double>(chosen_for_line) * distances->Pdf(t);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
float PathTracer<kTraits, Tracer, kDirectLight>::SampledShareOnLine(
    const Line& line, const LightSampleOf<Color>& light, Vec3f p, float pdf) const {
  if constexpr (kDirectLight == DirectLight::kBySampling) return 1;
  if constexpr (kDirectLight == DirectLight::kByMeeting) return light.is_delta ? 1 : 0;
  const double met_pdf = light.is_delta ? 0 : static_cast<double>(pdf);
  const double line_pdf = PdfByLine(line, light.light, p, line.t, light.pdf);
  if (kDirectLight == DirectLight::kByLines && line_pdf > 0) return 0;
  return static_cast<float>(PowerHeuristic(static_cast<double>(light.pdf) * line.density,
                                           met_pdf * line.density, line_pdf));
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
float PathTracer<kTraits, Tracer, kDirectLight>::MetShareOnLine(const Line& line, uint32_t emitter,
                                                                float sampled_pdf,
                                                                const Path& path) const {
  if constexpr (kDirectLight == DirectLight::kBySampling) return 0;
  if constexpr (kDirectLight == DirectLight::kByMeeting) return 1;
  const double line_pdf = PdfByLine(line, emitter, path.from, line.t, sampled_pdf);
  if (kDirectLight == DirectLight::kByLines && line_pdf > 0) return 0;
  return static_cast<float>(PowerHeuristic(static_cast<double>(path.pdf) * line.density,
                                           static_cast<double>(sampled_pdf) * line.density,
                                           line_pdf));
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
typename PathTracer<kTraits, Tracer, kDirectLight>::Color
PathTracer<kTraits, Tracer, kDirectLight>::ScatteredOnLine(const Line& line, double t,
                                                           const Color& left,
                                                           const LightSampleOf<Color>& light,
                                                           double line_pdf, const Path& path,
                                                           double* weight) const {
  const MediumMix<Color>& mix = path.media.mix;
  const Vec3f d = ToFloat(line.d);
  const auto weight_of = [&](double by_flight, float phase_pdf) -> double {
    if constexpr (kDirectLight != DirectLight::kByBoth) return 1;
    const double met_pdf = light.is_delta ? 0 : static_cast<double>(phase_pdf);
    return PowerHeuristic(line_pdf, static_cast<double>(light.pdf) * by_flight,
                          met_pdf * by_flight);
  };
  Color sum;
  if (!kVaryingLines || mix.scatters) {
    const auto phase = PhaseOnLine(line, t, path).Eval(d, light.wi);
    sum = left * mix.sigma_s * phase.f;
    *weight = weight_of(FlightDensity<kChromaticMedia>(mix, t, line.carried), phase.pdf);
  }
  if constexpr (kVaryingLines) {
    if (!mix.gathers) return sum;
    sum *= static_cast<float>(*weight);
    *weight = 1;
    const MediumTable& media = *scene_.media;
    for (const uint16_t medium : path.media.set) {
      if (!media.Gathers(medium)) continue;
      const auto its = media.template CoefficientsAt<Color>(medium, line.o + t * line.d,
                                                            TimeOfMedia<kTraits>(path.ray.time),
                                                            path.wavelengths, mix.form);
      if (its.sigma_s.IsBlack()) continue;
      const float phase = HenyeyGreenstein(media.PhaseAsymmetryOf(medium, mix.form), d, light.wi);
      const double its_weight =
          weight_of(MeanExtinction<kChromaticMedia>(its.sigma_t, line.carried), phase);
      sum += left * its.sigma_s * phase * static_cast<float>(its_weight);
    }
  }
  return sum;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::AddLightAlong(const Sampler& sampler,
                                                              const Line& line, const RawHit* hit,
                                                              uint32_t passes, Path* path) {
  if constexpr (kDirectLight == DirectLight::kBySampling) return;
  if constexpr (kDirectLight == DirectLight::kByMeeting) return;
  const MediumMix<Color>& mix = path->media.mix;
  if (scene_.lights->empty() || path->depth >= static_cast<uint32_t>(scene_.settings.max_depth)) {
    return;
  }
  if constexpr (kVaryingLines) {
    if (!(line.begin < line.length)) return;
  }
  const std::array<float, 4> u = sampler.Get4(LineSlot(NextVertex(*path), passes));
  const std::optional<ChosenLight> for_line =
      scene_.lights->Choose(line.where_chosen, u[2], {u[0], u[1]});
  if (!for_line) return;
  const auto distances = DistancesOn(line, for_line->light);
  if (!distances) return;
  const double t = distances->Sample(static_cast<double>(u[3]));
  const double distance_pdf = distances->Pdf(t);
  const Color left = line.carried * TransmittanceOf<kChromaticMedia>(mix, t);
  bool is_dark = (left * mix.sigma_s).IsBlack();
  if constexpr (kVaryingLines) is_dark = is_dark && (!mix.gathers || left.IsBlack());
  if (!(distance_pdf > 0) || is_dark) return;
  InMedia media = path->media;
  SurfacePoint here;
  here.p = PointInMedium(path->ray, hit, t / Length(ToDouble(path->ray.d)), &media.near);
  const ChosenLight chosen{for_line->light,
                           scene_.lights->ChoiceProbability(for_line->light, here.p)};
  if (!(chosen.probability > 0)) return;
  std::optional<LightSampleOf<Color>> light = scene_.lights->template SampleChosen<kTraits>(
      chosen, here.p, {u[0], u[1]}, path->wavelengths);
  if (!light) return;
  if constexpr (kMayPass && Has(kTraits, Trait::kVaryingEmission)) {
    if (light->cut_out != kNone) light->radiance *= ShareOfCutOut(*light);
  }
  const double line_pdf = static_cast<double>(light->pdf) /
                          static_cast<double>(chosen.probability) *
                          static_cast<double>(for_line->probability) * distance_pdf;
  double weight = 1;
  const Color scattered = ScatteredOnLine(line, t, left, *light, line_pdf, *path, &weight);
  if (scattered.IsBlack()) return;
  Color share = Color::Grey(1);
  if constexpr (kVaryingMedia) {
    if (mix.varies) {
      share = ShareThroughVarying(path->ray, {u[0], u[1]}, passes, t, *path, path->media);
      if (share.IsBlack()) return;
    }
  }
  CountScattering(*path, &media);  // The light comes through what follows a scattering there.
  share *= ShareThroughMedia(here, *light, {u[3], u[2]}, *path, media);
  if (share.IsBlack()) return;
  const auto scale = static_cast<float>(weight / line_pdf);
  AddLight(light->light, path->history.KindFromMedium(),
           scattered * share * light->radiance * scale, path);
}

}  // namespace sheaf::render
