// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Equiangular (line) sampling: each segment of a path in scattering media samples one light, chosen
// for the whole segment, and a distance along it in proportion to how strongly the light
// illuminates it. This is a third technique to find a point of a medium and a point of a light,
// beside a distance sample followed by a light sample or by a hit of a light. The power heuristic
// combines the three, over densities of both points. If heterogeneous media are present too, the
// density of a distance sample that a homogeneous medium ends is taken as if they were absent:
// weights need only be the same function of the two points, and of the scattering medium, for every
// technique. Subsurface walks are short and count no depth: they do not use this technique.
//
// In heterogeneous media the density of distance samples is unknown. The extinction at the point
// stands in its place, as if the transmittance were 1: with a known transmittance T the line
// density p would compete with extinction * T; the estimate of T is nearly always close to 0 or to
// 1 in thick media, which is the same as lines with the density p * T. In thin media T is about 1,
// and the weights are those of the true densities. Heterogeneous media are sampled so only where
// distance samples alone are noisy (DistancesOn).
//
// Sources: Kulla and Fajardo 2012; Veach 1997, ch. 9. docs/adr/0024-light-along-lines.md.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <utility>

#include "worker/render/integrator/guided_directions.h"
#include "worker/render/integrator/medium_line.h"
#include "worker/render/integrator/mis_weights.h"
#include "worker/render/integrator/point_in_medium.h"
#include "worker/render/integrator/ray_sight.h"
#include "worker/render/integrator/transmittance.h"
#include "worker/render/integrator/visibility.h"

namespace sheaf::render {

// Notes that the path was scattered at distance t of the line.
template <typename C>
void RecordLineScattering(const Context<C>& c, const LineOf<C>& line, double t,
                          [[maybe_unused]] MediumScatterer scatterer, PathState<C>* path) {
  using Color = typename C::Color;
  const MediumProperties<Color>& properties = path->media.properties;
  LineOf<C>& kept = path->media.line;
  kept = line;
  kept.t = t;
  if constexpr (C::kHeterogeneousLines) {
    if (scatterer) {
      const MediumTable& media = *c.scene.media;
      kept.has_scattered = UsesLineSampling<C>(properties) && media.Gathers(*scatterer);
      if (!kept.has_scattered) return;
      const auto its = media.template CoefficientsAt<Color>(*scatterer, line.o + t * line.d,
                                                            TimeOfMedia<C::kTraits>(path->ray.time),
                                                            path->wavelengths, properties.form);
      kept.density = MeanExtinction<C::kChromaticMedia>(its.sigma_t, CarriedOf<C>(line));
      return;
    }
  }
  kept.has_scattered = !scatterer && UsesLineSampling<C>(properties);
  kept.density = DistancePdf<C::kChromaticMedia>(properties, t, CarriedOf<C>(line));
}

template <typename C>
PhaseMixture<typename C::Color> PhaseOnLine(const Context<C>& c, const LineOf<C>& line, double t,
                                            const PathState<C>& path) {
  using Color = typename C::Color;
  const MediumProperties<Color>& properties = path.media.properties;
  if constexpr (C::kBothEnds) {
    return c.scene.media->template PhaseOf<Color>(path.media.set, properties, Color::Gray(1),
                                                  path.wavelengths,
                                                  path.media.subsurface_texture.OrNull());
  }
  const Color scattered =
      line.carried * TransmittanceOf<C::kChromaticMedia>(properties, t) * properties.sigma_s;
  return c.scene.media->template PhaseOf<Color>(path.media.set, properties, scattered,
                                                path.wavelengths,
                                                path.media.subsurface_texture.OrNull());
}

// The densities of all techniques for p, where the path was scattered on the line, and a point of
// the light that light sampling finds with light_pdf and scattering with scattering_pdf. known:
// what is known of the lights at p.
template <typename C>
TechniquePdfs PdfsOnLine(const Context<C>& c, const LineOf<C>& line, uint32_t light, Vec3f p,
                         LightVisibilityRow known, float light_pdf, double scattering_pdf) {
  return {static_cast<double>(light_pdf) * line.density, scattering_pdf * line.density,
          LineTechniquePdf(c, line, light, p, known, line.t, light_pdf)};
}

// The weight of a light sample at p, where scattering towards the light has density pdf. known:
// what is known of the lights at p.
template <typename C>
float LightSampleWeightOnLine(const Context<C>& c, const LineOf<C>& line,
                              const LightSampleOf<typename C::Color>& light, Vec3f p,
                              LightVisibilityRow known, float pdf) {
  if constexpr (C::kDirectLight == DirectLight::kBySampling) return 1;
  if constexpr (C::kDirectLight == DirectLight::kByHitting) return light.is_delta ? 1 : 0;
  const double scattering_pdf = light.is_delta ? 0 : static_cast<double>(pdf);
  return static_cast<float>(
      MisWeight<C>(FindsBy::kLightSample,
                   PdfsOnLine(c, line, light.light, p, known, light.pdf, scattering_pdf)));
}
// The weight of an emitter that the path's ray hits, where light sampling has density light_pdf.
template <typename C>
float HitWeightOnLine(const Context<C>& c, const LineOf<C>& line, uint32_t emitter, float light_pdf,
                      const PathState<C>& path) {
  if constexpr (C::kDirectLight == DirectLight::kBySampling) return 0;
  if constexpr (C::kDirectLight == DirectLight::kByHitting) return 1;
  return static_cast<float>(
      MisWeight<C>(FindsBy::kHit, PdfsOnLine(c, line, emitter, path.from, LightsFromLast<C>(path),
                                             light_pdf, static_cast<double>(path.pdf))));
}

// The weight of a line sample of the light at p. phase_pdf: of scattering towards the light.
template <typename C>
double LineSampleWeight(const Context<C>& c, const TechniquePdfs& pdfs,
                        const LightSampleOf<typename C::Color>& light, [[maybe_unused]] Vec3f p,
                        [[maybe_unused]] float phase_pdf, const PathState<C>& path) {
  if constexpr (C::kBothEnds) {
    const double light_paths =
        pdfs.light * LightPathsOverSampleOnLine(c, p, light, phase_pdf, path);
    return static_cast<double>(WeightBesideLight(
        c, {pdfs.light / pdfs.line, pdfs.scattering / pdfs.line}, light_paths / pdfs.line));
  }
  return MisWeight<C>(FindsBy::kLine, pdfs);
}

// The light that is scattered at p, at t, towards the line's start, per incident radiance, times
// *weight. guided: the directions known there. left: the path's throughput at t after the
// homogeneous media. line_pdf: that of weights.
template <typename C>
typename C::Color InScatteringOnLine(const Context<C>& c, const LineOf<C>& line, double t,
                                     [[maybe_unused]] Vec3f p, const typename C::Color& left,
                                     const LightSampleOf<typename C::Color>& light, double line_pdf,
                                     const GuidedDirectionsOf<C>& guided, const PathState<C>& path,
                                     double* weight) {
  using Color = typename C::Color;
  const MediumProperties<Color>& properties = path.media.properties;
  const Vec3f d = ToFloat(line.d);
  const auto weight_of = [&](double distance_density, float phase_pdf) {
    const double scattering_pdf =
        light.is_delta ? 0 : static_cast<double>(guided.Pdf(phase_pdf, light.wi));
    const TechniquePdfs pdfs{static_cast<double>(light.pdf) * distance_density,
                             scattering_pdf * distance_density, line_pdf};
    return LineSampleWeight(c, pdfs, light, p, phase_pdf, path);
  };
  Color sum;
  if (!C::kHeterogeneousLines || properties.scatters) {
    const auto phase = PhaseOnLine(c, line, t, path).Eval(d, light.wi);
    sum = left * properties.sigma_s * phase.f;
    *weight =
        weight_of(DistancePdf<C::kChromaticMedia>(properties, t, CarriedOf<C>(line)), phase.pdf);
  }
  if constexpr (C::kHeterogeneousLines) {
    if (!properties.gathers) return sum;
    sum *= static_cast<float>(*weight);
    *weight = 1;
    const MediumTable& media = *c.scene.media;
    const auto add = [&](uint16_t medium) {
      if (!media.Gathers(medium)) return;
      const auto its = media.template CoefficientsAt<Color>(medium, line.o + t * line.d,
                                                            TimeOfMedia<C::kTraits>(path.ray.time),
                                                            path.wavelengths, properties.form);
      if (its.sigma_s.IsBlack()) return;
      const float phase =
          HenyeyGreenstein(media.PhaseAsymmetryOf(medium, properties.form), d, light.wi);
      const double its_weight =
          weight_of(MeanExtinction<C::kChromaticMedia>(its.sigma_t, CarriedOf<C>(line)), phase);
      sum += left * its.sigma_s * phase * static_cast<float>(its_weight);
    };
    for (const uint16_t medium : path.media.set) {
      for (const uint16_t member : media.MembersOf(medium)) add(member);
    }
  }
  return sum;
}

// Adds light from one light that is scattered once on the way to the line's start. length: of the
// path's segment.
template <typename C>
void SampleLdOnLine(const Context<C>& c, const LineOf<C>& line, [[maybe_unused]] double length,
                    const RawHit* hit, PathState<C>* path) {
  using Color = typename C::Color;
  if constexpr (C::kDirectLight == DirectLight::kBySampling) return;
  if constexpr (C::kDirectLight == DirectLight::kByHitting) return;
  const CompiledScene& scene = c.scene;
  const MediumProperties<Color>& properties = path->media.properties;
  if (scene.lights->empty() || path->depth >= static_cast<uint32_t>(scene.settings.max_depth)) {
    return;
  }
  double end = line.length;
  if constexpr (C::kBothEnds) end = std::min(end, length);
  if constexpr (C::kHeterogeneousLines) {
    if (!(line.begin < end)) return;
  }
  const std::array<float, 4> u =
      c.sampler.Get4(EquiangularSlot(NextVertexIndex(*path), path->null_crossings));
  const std::optional<ChosenLight> for_line =
      scene.lights->Choose(line.choice_point, u[2], {u[0], u[1]});
  if (!for_line) return;
  const auto known_distances = DistancesOn(c, line, for_line->light);
  if (!known_distances) return;
  auto distances = known_distances;
  if constexpr (C::kBothEnds) {
    distances =
        DistancesTo(scene.lights->BoundsOf(for_line->light), line.o, line.d, line.begin, end);
    if (!distances) return;
  }
  const double t = distances->Sample(static_cast<double>(u[3]));
  const double distance_pdf = distances->Pdf(t);
  const Color left = line.carried * TransmittanceOf<C::kChromaticMedia>(properties, t);
  bool is_dark = (left * properties.sigma_s).IsBlack();
  if constexpr (C::kHeterogeneousLines)
    is_dark = is_dark && (!properties.gathers || left.IsBlack());
  if (!(distance_pdf > 0) || is_dark) return;
  MediumState<C> media = path->media;
  SurfacePoint vertex;
  if (NeedsExactPlace<C>(media, path->ray)) {
    vertex.p = ExactPointInMedium(c, path->ray, hit, t, end, &media.near);
  } else {
    vertex.p = PointInMedium(c, path->ray, hit, t / Length(ToDouble(path->ray.d)), &media.near);
    media.near.has_offset = false;
  }
  const GuidedDirectionsOf<C> guided = GuidedDirectionsAt(c, {vertex.p});
  const ChosenLight chosen{for_line->light, scene.lights->ChoiceProbability(
                                                for_line->light, vertex.p, {}, guided.lights())};
  if (!(chosen.probability > 0)) return;
  std::optional<LightSampleOf<Color>> light = scene.lights->template SampleChosen<C::kTraits>(
      chosen, vertex.p, {u[0], u[1]}, path->wavelengths, guided.lights());
  if (!light || !IsSeenInMedium(c, vertex.p, *path, &*light)) return;
  ApplyCutOut(c, &*light);
  const double line_pdf = static_cast<double>(light->pdf) /
                          static_cast<double>(chosen.probability) *
                          static_cast<double>(for_line->probability) * distance_pdf;
  double known_pdf = line_pdf;
  if constexpr (C::kBothEnds) {
    known_pdf *= known_distances->Pdf(t) / distance_pdf;
    if (!(known_pdf > 0)) return;
  }
  double weight = 1;
  const Color scattered =
      InScatteringOnLine(c, line, t, vertex.p, left, *light, known_pdf, guided, *path, &weight);
  if (scattered.IsBlack()) return;
  Color transmittance = Color::Gray(1);
  if constexpr (C::kHeterogeneous) {
    if (properties.is_heterogeneous) {
      transmittance = TransmittanceHeterogeneous(c, path->ray, {u[0], u[1]}, path->null_crossings,
                                                 t, *path, path->media);
      if (transmittance.IsBlack()) return;
    }
  }
  CountScattering(c, *path, &media);  // The light passes through the media after that scattering.
  transmittance *= ShadowTransmittance(c, vertex, *light, {u[3], u[2]}, *path, std::move(media));
  if (transmittance.IsBlack()) return;
  const auto scale = static_cast<float>(weight / line_pdf);
  AddLight(c, light->light, path->history.KindFromMedium(),
           scattered * transmittance * light->radiance * scale, path);
}

}  // namespace sheaf::render
