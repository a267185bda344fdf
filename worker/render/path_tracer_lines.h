// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathTracer, light along lines through media that are the same everywhere. Included by
// path_tracer.h. Each segment of a path in such media gathers light scattered once, from a light
// chosen for the whole line and at a distance drawn by how that light shines along it; that is the
// third way to a point of a medium and a point of a light, beside a flight that ends there followed
// by a sampled or a met light. The three are combined by the power heuristic, over densities of
// both points. Where media that vary are there too, the density of a flight is taken as if they
// were not: weights need only be the same function of the two points for every technique. Walks in
// matter are short and count no depth: they do without lines.
//
// Sources: Kulla and Fajardo 2012; Veach 1997, ch. 9. docs/adr/0024-light-along-lines.md.
#pragma once

#include <algorithm>
#include <array>

#include "worker/render/equiangular.h"
#include "worker/render/path_tracer.h"

namespace sheaf::render {

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
typename PathTracer<kTraits, Tracer, kDirectLight>::Line
PathTracer<kTraits, Tracer, kDirectLight>::LineOf(const Path& path, double length) {
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
  line.where_chosen = ToFloat(line.o + (0.5 * std::min(length, 2 / sigma_t)) * line.d);
  return line;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
PhaseMix<typename PathTracer<kTraits, Tracer, kDirectLight>::Color>
PathTracer<kTraits, Tracer, kDirectLight>::PhaseOnLine(const Line& line, double t,
                                                       const Path& path) const {
  const MediumMix<Color>& mix = path.media.mix;
  const Color scattered = line.carried * TransmittanceOf<kChromaticMedia>(mix, t) * mix.sigma_s;
  return scene_.media->template PhaseOf<Color>(path.media.set, mix, scattered, path.wavelengths);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
double PathTracer<kTraits, Tracer, kDirectLight>::PdfByLine(const Line& line, uint32_t light,
                                                            Vec3f p, double t,
                                                            float pdf_sampled) const {
  const auto distances = DistancesTo(scene_.lights->BoundsOf(light), line.o, line.d, line.length);
  const float chosen_there = scene_.lights->ChoiceProbability(light, p);
  if (!distances || !(chosen_there > 0)) return 0;
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
void PathTracer<kTraits, Tracer, kDirectLight>::AddLightAlong(const Sampler& sampler,
                                                              const Line& line, const RawHit* hit,
                                                              uint32_t passes, Path* path) {
  if constexpr (kDirectLight == DirectLight::kBySampling) return;
  if constexpr (kDirectLight == DirectLight::kByMeeting) return;
  const MediumMix<Color>& mix = path->media.mix;
  if (scene_.lights->empty() || path->depth >= static_cast<uint32_t>(scene_.settings.max_depth)) {
    return;
  }
  const std::array<float, 4> u = sampler.Get4(LineSlot(NextVertex(*path), passes));
  const std::optional<ChosenLight> for_line =
      scene_.lights->Choose(line.where_chosen, u[2], {u[0], u[1]});
  if (!for_line) return;
  const auto distances =
      DistancesTo(scene_.lights->BoundsOf(for_line->light), line.o, line.d, line.length);
  if (!distances) return;
  const double t = distances->Sample(static_cast<double>(u[3]));
  const double distance_pdf = distances->Pdf(t);
  Color carried = line.carried * TransmittanceOf<kChromaticMedia>(mix, t) * mix.sigma_s;
  if (!(distance_pdf > 0) || carried.IsBlack()) return;
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
  const auto phase = PhaseOnLine(line, t, *path).Eval(ToFloat(line.d), light->wi);
  const double line_pdf = static_cast<double>(light->pdf) /
                          static_cast<double>(chosen.probability) *
                          static_cast<double>(for_line->probability) * distance_pdf;
  double weight = 1;
  if constexpr (kDirectLight == DirectLight::kByBoth) {
    const double density = FlightDensity<kChromaticMedia>(mix, t, line.carried);
    const double met_pdf = light->is_delta ? 0 : static_cast<double>(phase.pdf);
    weight = PowerHeuristic(line_pdf, static_cast<double>(light->pdf) * density, met_pdf * density);
  }
  CountScattering(*path, &media);  // The light comes through what follows a scattering there.
  Color share = ShareThroughMedia(here, *light, {u[3], u[2]}, *path, media);
  if constexpr (kVaryingMedia) {
    if (mix.varies && !share.IsBlack()) {
      share *= ShareThroughVarying(path->ray, {u[0], u[1]}, passes, t, *path, path->media);
    }
  }
  if (share.IsBlack()) return;
  const auto scale = static_cast<float>(weight / line_pdf);
  AddLight(light->light, carried * phase.f * share * light->radiance * scale, path);
}

}  // namespace sheaf::render
