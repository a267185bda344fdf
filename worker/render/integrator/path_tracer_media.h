// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PathTracer, the part in participating media: which of them a path is in, how far it flies, and
// where it is scattered there. Included by path_tracer.h. A vertex in a medium counts as a vertex
// on a surface does, as in pbrt-v4's volpath; what shines along a segment is added in closed form,
// and does not count. Sources: pbrt-v4, ch. 14; Simon et al. 2017, "Line Integration for Rendering
// Heterogeneous Emissive Volumes".
#pragma once

#include <array>
#include <limits>
#include <optional>

#include "common/base/check.h"
#include "worker/render/integrator/path_tracer.h"

namespace sheaf::render {

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::StartInMedia(Path* path) const {
  path->media.camera_o = path->ray.o;
  if (!scene_.media) return;
  path->media.set = scene_.media->camera_media();
  if constexpr (kNested) {
    if (scene_.interiors) {
      path->media.interiors = scene_.interiors->camera_interiors();
      const uint16_t top = TopOf(path->media.interiors);
      const int32_t medium = top == kNoRank ? kNone : scene_.interiors->MediumOf(top);
      const MediumSet& declared = path->media.set;
      // A camera within matter may be said to be in its medium, or in what is outside of it.
      if (medium != kNone && (declared.empty() || *declared.begin() != medium)) {
        const bool fits = path->media.set.Add(static_cast<uint16_t>(medium));
        SHEAF_CHECK(fits);
      }
    }
  }
  path->media.mix =
      scene_.media->template MixOf<Color>(path->media.set, path->wavelengths, MediumForm::kTrue);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::CountScattering(const Path& path,
                                                                InMedia* media) const {
  const auto similar_after = static_cast<uint32_t>(scene_.settings.similarity_after);
  if (++media->scatterings != similar_after) return;
  media->mix.form = MediumForm::kReduced;
  MixAgain(path, media);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::Cross(const SurfacePoint& point, Vec3f w,
                                                      const Path& path, InMedia* media) const {
  const bool enters = Dot(w, point.ng) < 0;
  media->near = {point.p, enters ? -point.ng : point.ng, true};
  const Crossing crossing{point.id, point.p, point.p_error, point.ng, enters};
  if (IsSameCrossing(crossing, media->last)) return true;
  media->last = crossing;
  if constexpr (kPaintsMatter) {
    if (enters && point.surface->encloses_matter) {
      media->paint = {};
      if (point.surface->paints_matter) {
        media->paint.share = scene_.materials->MatterAlbedo(
            point.surface->material, TexturePointOf(point), path.wavelengths);
      }
    }
  }
  if constexpr (kNested) {
    if (point.surface->rank != kNoRank) {
      if (!CrossInterior(*point.surface, enters, media)) {
        counts_.CountBroken(point.surface->shape);
        return false;
      }
      MixAgain(path, media);
      return true;
    }
  }
  return MeetMedia(point, enters, !enters, path, media);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::MeetMedia(const SurfacePoint& point,
                                                          bool from_front, bool to_front,
                                                          const Path& path, InMedia* media) const {
  const Surface& surface = *point.surface;
  if (!surface.media.Separates()) return true;
  const auto index_of = [this](int32_t medium) {
    return medium == kNone ? std::nullopt : std::optional(scene_.media->IndexOf(medium));
  };
  const MediumSides sides{index_of(surface.media.inside), index_of(surface.media.outside)};
  const Nesting nesting = MeetSides(sides, from_front, to_front, &media->set);
  const bool contradicts = nesting == Nesting::kContradicted;
  if (nesting != Nesting::kRight) counts_.CountBroken(surface.shape);
  // Walks in matter rely on having come in through its boundary.
  const bool leaves_matter = surface.encloses_matter && !from_front;
  if (nesting == Nesting::kFull || (contradicts && leaves_matter)) return false;
  if (contradicts || from_front != to_front) MixAgain(path, media);
  return true;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::CrossOrStay(const SurfacePoint& point, Vec3f w,
                                                            bool is_hair, const Path& path,
                                                            InMedia* media) const {
  const float came_along = Dot(path.ray.d, point.ng), goes_along = Dot(w, point.ng);
  if (!is_hair && came_along * goes_along > 0) return Cross(point, w, path, media);
  const bool in_front = goes_along >= 0;
  media->near = {point.p, in_front ? point.ng : -point.ng, !is_hair};
  if (is_hair || (kNested && point.surface->rank != kNoRank)) return true;
  return MeetMedia(point, in_front, in_front, path, media);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
typename PathTracer<kTraits, Tracer, kDirectLight>::Color
PathTracer<kTraits, Tracer, kDirectLight>::ShareThroughMedia(const SurfacePoint& point,
                                                             const LightSampleOf<Color>& light,
                                                             std::array<float, 2> u_pass,
                                                             const Path& path, InMedia media) {
  Vec3f end{};
  const Ray ray = ShadowRay(point, light, path.ray.time, &end);
  return PassThroughMedia(ray, light.is_infinite ? nullptr : &end, u_pass, path, std::move(media),
                          nullptr);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
template <typename OnSegment>
typename PathTracer<kTraits, Tracer, kDirectLight>::Color
PathTracer<kTraits, Tracer, kDirectLight>::PassThroughMedia(Ray ray, const Vec3f* end,
                                                            std::array<float, 2> u_pass,
                                                            const Path& path, InMedia media,
                                                            const OnSegment& on_segment) {
  constexpr bool kLooksOn = !std::is_null_pointer_v<OnSegment>;
  Color share = Color::Grey(1);
  for (uint32_t pass = 0; pass < kPassesMax; ++pass) {
    ++counts_.rays;
    ++counts_.shadow_rays;
    RawHit hit;
    bool meets = false;
    if constexpr (kMayPass || kLooksOn) {
      meets = tracer_.Intersect(ray, &hit);
    } else {
      if (tracer_.Occluded(ray)) return {};
    }
    const bool is_endless = !meets && end == nullptr;
    double length = std::numeric_limits<double>::infinity();
    if (!is_endless) length = Length(ToDouble(ray.d)) * (meets ? static_cast<double>(hit.t) : 1);
    if constexpr (kLooksOn) on_segment(ray, pass, length, share, media);
    std::optional<SurfacePoint> met;
    if (meets) {
      met = MakeSurfacePoint<kTraits>(scene_.geometry, ray, hit);
      // Pass numbers from 1 on: the slot's own numbers have been used to choose the light.
      if (!LetsPass(*met, MakeChoice(u_pass, pass + 1)) &&
          !LetsPassByPriority(*met, ray.d, path, media)) {
        return {};
      }
    }
    if constexpr (kNested) {
      if (is_endless && !media.interiors.empty()) {
        ++counts_.broken_nestings;
        return {};
      }
    }
    if (!media.set.empty()) {
      if (is_endless && media.mix.is_bounded) {
        ++counts_.broken_nestings;
        return {};
      }
      share *= TransmittanceOf<kChromaticMedia>(media.mix, length);
      if constexpr (kVaryingMedia) {
        if (media.mix.varies && !share.IsBlack()) {
          share *= ShareThroughVarying(ray, u_pass, pass, length, path, media);
        }
      }
      if (share.IsBlack()) return {};
    }
    if (!meets) return share;
    if (!Cross(*met, ray.d, path, &media)) return {};
    ray.o = OffsetRayOrigin(met->p, met->p_error, met->ng, ray.d);
    ray.source = met->id;
    if (end != nullptr) ray.d = *end - ray.o;
  }
  return {};
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
Vec3f PathTracer<kTraits, Tracer, kDirectLight>::PointInMedium(const Ray& ray, const RawHit* hit,
                                                               double t, NearPlane* near) const {
  // Points within this many bounds behind a surface were put there by rounding.
  constexpr double kReach = 8;
  const auto on_its_side = [](const NearPlane& plane, Vec3f p) {
    const Vec3f n = Abs(plane.n);
    const double bound = static_cast<double>(Gamma(2)) * (Dot(ToDouble(n), ToDouble(Abs(p))) +
                                                          Dot(ToDouble(n), ToDouble(Abs(plane.p))));
    const double distance = Dot(ToDouble(p) - ToDouble(plane.p), ToDouble(plane.n));
    if (distance >= bound || distance < -kReach * bound) return p;
    return ToFloat(ToDouble(p) + ToDouble(plane.n) * (bound - distance));
  };
  Vec3f p = ToFloat(ToDouble(ray.o) + ToDouble(ray.d) * t);
  if (near->is_set) p = on_its_side(*near, p);
  if (hit == nullptr) return p;
  // Rounding matters next to a surface only. Grazing rays are next to it for longer.
  constexpr double kNearness = 0x1p-8;
  const double ahead = static_cast<double>(hit->t) - t;
  const Vec3f o = Abs(ray.o);
  const double size = static_cast<double>(std::max(o.x, std::max(o.y, o.z))) +
                      static_cast<double>(hit->t) * Length(ToDouble(ray.d));
  if (ahead * Length(ToDouble(ray.d)) > kNearness * size) return p;
  const SurfacePoint met = MakeSurfacePoint<kTraits>(scene_.geometry, ray, *hit);
  *near = {met.p, Dot(ray.d, met.ng) > 0 ? -met.ng : met.ng, true};
  if constexpr (kSubsurface) near->p_error = ErrorAlongNormal(met);
  return on_its_side(*near, p);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::RecordMedium(Vec3f p,
                                                             [[maybe_unused]] Scatterer scatterer,
                                                             const Path& path,
                                                             FilmSample* film) const {
  const MediumForm form = path.media.mix.form;
  const Rgb* paint = nullptr;
  if constexpr (std::is_same_v<Color, Rgb>) paint = path.media.paint.OrNull();
  MediumMix<Rgb> mix = scene_.media->template MixOf<Rgb>(path.media.set, {}, form, paint);
  if constexpr (kVaryingMedia) {
    if (scatterer) {
      const auto its = scene_.media->template CoefficientsAt<Rgb>(
          *scatterer, ToDouble(p), TimeOfMedia<kTraits>(path.ray.time), {}, form);
      mix.sigma_t = its.sigma_t;
      mix.sigma_s = its.sigma_s;
    }
  }
  film->albedo = MakeColor<Rgb>(
      [&](size_t i) { return mix.sigma_t[i] > 0 ? mix.sigma_s[i] / mix.sigma_t[i] : 0; });
  film->alpha = 1;
  film->normal = {};
  film->depth = Length(p - path.media.camera_o);
  if constexpr (kOutputs) {
    if (outputs_ != nullptr) RecordFirstEventInMedium(scene_, path.ray, p, outputs_);
  }
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
void PathTracer<kTraits, Tracer, kDirectLight>::AddGlow([[maybe_unused]] const Sampler& sampler,
                                                        [[maybe_unused]] uint32_t passes,
                                                        double length, Path* path) {
  const MediumMix<Color>& mix = path->media.mix;
  if (mix.emission.IsBlack() && !mix.glows) return;
  Color arriving = path->throughput * [&] {
    if constexpr (kVaryingMedia) {
      if (mix.varies) {
        return EmissionAmongVarying(path->ray,
                                    sampler.Get4(Slot(NextVertex(*path), VertexSlot::kMedium)),
                                    passes, length, *path, path->media);
      }
    }
    return EmissionAlong(mix, length);
  }();
  if constexpr (kSamplesGlow) arriving *= MetShareOfGlow(*path);
  path->radiance += arriving;
  if constexpr (kOutputs) groups_.AddGlow(scene_.media_group, arriving);
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
typename PathTracer<kTraits, Tracer, kDirectLight>::Travel
PathTracer<kTraits, Tracer, kDirectLight>::TravelThroughMedia(const Sampler& sampler,
                                                              const RawHit* hit, uint32_t* passes,
                                                              bool* is_first, Path* path,
                                                              FilmSample* film) {
  InMedia& media = path->media;
  if constexpr (kNested) {
    if (hit == nullptr && !media.interiors.empty()) {
      ++counts_.broken_nestings;
      return Travel::kEnded;
    }
  }
  if (media.set.empty()) return Travel::kArrived;
  if constexpr (kSubsurface) {
    if (path->matter.has_arrived && hit != nullptr) return Travel::kArrived;
  }
  if (hit == nullptr && media.mix.is_bounded) {
    ++counts_.broken_nestings;
    return Travel::kEnded;
  }
  const double unit = Length(ToDouble(path->ray.d));
  const double length =
      hit == nullptr ? std::numeric_limits<double>::infinity() : static_cast<double>(hit->t) * unit;
  if constexpr (Has(kTraits, Trait::kEmissiveMedia)) AddGlow(sampler, *passes, length, path);
  [[maybe_unused]] std::conditional_t<kLines, Line, NoLine> line;
  if constexpr (kLines) {
    if (GathersAlongLines(media.mix)) {
      line = LineOf(*path, length);
      AddLightAlong(sampler, line, hit, *passes, path);
    }
  }
  Scatterer scatterer;
  const Flight<Color> flight = [&] {
    if constexpr (kVaryingMedia) {
      if (media.mix.varies) {
        return FlyThroughVarying(path->ray,
                                 sampler.Get4(Slot(NextVertex(*path), VertexSlot::kMedium)),
                                 *passes, length, *path, &scatterer);
      }
    }
    FlightNumbers u;
    if (media.mix.scatters) {
      u = MakeFlightNumbers(sampler.Get4(Slot(NextVertex(*path), VertexSlot::kMedium)), *passes);
    }
    return SampleFlight<kChromaticMedia>(media.mix, length, u, path->throughput);
  }();
  path->throughput *= flight.weight;
  if (path->throughput.IsBlack()) return Travel::kEnded;
  if (!flight.scatters) {
    if constexpr (kSubsurface) path->matter.offset = {};
    return Travel::kArrived;
  }
  *passes = 0;
  if constexpr (kLines) EndLine(line, flight.distance, scatterer, path);
  const double t = flight.distance / unit;
  const Vec3f p = PointInMedium(path->ray, hit, t, &media.near);
  if (*is_first) {
    *is_first = false;
    RecordMedium(p, scatterer, *path, film);
  }
  if (!CountVertex(media.mix.is_matter, path)) return Travel::kEnded;
  if constexpr (kSubsurface) {
    if (media.mix.is_matter) {
      PlaceInMatter(ToDouble(path->ray.o) + path->matter.offset + ToDouble(path->ray.d) * t, p,
                    path);
    }
  }
  return ScatterInMedium(sampler, p, scatterer, path) ? Travel::kScattered : Travel::kEnded;
}

template <uint32_t kTraits, typename Tracer, DirectLight kDirectLight>
bool PathTracer<kTraits, Tracer, kDirectLight>::ScatterInMedium(
    const Sampler& sampler, Vec3f p, [[maybe_unused]] Scatterer scatterer, Path* path) {
  const Vec3f d = Normalize(path->ray.d);
  const PhaseMix<Color> phase = [&] {
    if constexpr (kVaryingMedia) {
      if (scatterer) {
        PhaseMix<Color> its;
        its.Add(scene_.media->PhaseAsymmetryOf(*scatterer, path->media.mix.form), Color::Grey(1),
                1);
        return its;
      }
    }
    if constexpr (kLines) {
      const Line& line = path->media.line;
      if (line.has_scattered) return PhaseOnLine(line, line.t, *path);
    }
    return scene_.media->template PhaseOf<Color>(path->media.set, path->media.mix, path->throughput,
                                                 path->wavelengths, path->media.paint.OrNull());
  }();
  CountScattering(*path, &path->media);
  SurfacePoint here;  // Without a normal there is no side, and nothing to be kept away from.
  here.p = p;
  if (!scene_.lights->empty() && !path->media.mix.is_hidden) {
    const LightDraw draw = DrawLight(sampler, LastVertex(*path));
    const std::array<float, 4>& u = draw.u;
    std::optional<LightSampleOf<Color>> light = scene_.lights->template Sample<kTraits>(
        p, {}, u[2], {u[0], u[1]}, path->wavelengths, draw.preparation);
    if (light.has_value()) {
      if constexpr (kMayPass && Has(kTraits, Trait::kVaryingEmission)) {
        if (light->cut_out != kNone) light->radiance *= ShareOfCutOut(*light);
      }
      const typename PhaseMix<Color>::Value value = phase.Eval(d, light->wi);
      const Color share = ShareThroughMedia(here, *light, {u[3], u[2]}, *path, path->media);
      if (!share.IsBlack()) {
        const float of_sample = [&] {
          if constexpr (kLines) {
            const Line& line = path->media.line;
            if (line.has_scattered) return SampledShareOnLine(line, *light, p, value.pdf);
          }
          return ShareOfSample(*light, value.pdf);
        }();
        AddSampled(*light, p, value.f * share, of_sample, path->history.KindFromMedium(), path);
      }
    }
  }
  if constexpr (kSamplesGlow) {
    if (!path->media.mix.is_hidden) {
      const auto towards = [&](Vec3f w, InMedia*) {
        const typename PhaseMix<Color>::Value value = phase.Eval(d, w);
        return BsdfValueOf<Color>{value.f, value.pdf};
      };
      AddSampledGlow(sampler, here, towards, path);
    }
  }
  const std::array<float, 4> u = sampler.Get4(Slot(LastVertex(*path), VertexSlot::kBsdf));
  const typename PhaseMix<Color>::Sample sample = phase.SampleDirection(d, u[2], {u[0], u[1]});
  path->throughput *= sample.weight;
  if (path->throughput.IsBlack()) return false;
  path->specular = path->media.mix.is_hidden;
  path->history.AddMedium(path->media.mix.is_matter);
  path->pdf = sample.pdf;
  path->from = p;
  path->from_n = {};
  path->ray.o = p;
  path->ray.d = sample.w;
  path->ray.source = {};
  path->sky_place = scene_.lights->template PrepareEnvironment<kTraits>(sample.w);
  return SurvivesRoulette(u[3], path);
}

}  // namespace sheaf::render
