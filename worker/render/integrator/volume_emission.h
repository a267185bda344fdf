// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Emission of media. Each segment of a path adds the emission along it. Where emissive media are
// heterogeneous, each vertex also samples a direction towards their emission and adds that of all
// media along it, up to the first surface that is not a null interface; the two are combined by
// multiple importance sampling over directions. Beside light paths, these are a third technique,
// which finds the emission along the same line (emission_points.h). Sources: Simon et al. 2017,
// "Line Integration for Rendering Heterogeneous Emissive Volumes"; emissive_volume_sampler.h.
#pragma once

#include <array>
#include <cstdint>
#include <utility>

#include "worker/render/integrator/mis_weights.h"
#include "worker/render/integrator/ray_sight.h"
#include "worker/render/integrator/transmittance.h"
#include "worker/render/integrator/two_ends.h"

namespace sheaf::render {

// Whether directions are sampled by the emission of media. Not where shadow rays meet other shapes
// than scattered ones, which find the emission alone then.
template <typename C>
bool SamplesEmission([[maybe_unused]] const Context<C>& c) {
  if constexpr (C::kRayKinds) return !c.scene.visibility.splits_shadow;
  return true;
}

// The weight of emission along the path's ray.
template <typename C>
float EmissionHitWeight(const Context<C>& c, const PathState<C>& path) {
  if constexpr (C::kBothEnds) {
    const double sampled = path.specular ? 0 : MediaPdf(c, path.from, path.ray.d);
    const bool is_reached =
        path.other_end.light_paths.IsFound() && c.scene.media->BeginsLightPaths(path.media.set);
    const double emitted = is_reached ? MediaDensityAt(c, path.from, path.ray.d) : 0;
    return HitWeight(c, sampled, emitted, path);
  } else {
    const EmissiveVolumeSampler& lights = c.scene.media->emissive_volumes();
    if (path.specular || lights.empty() || !SamplesEmission(c)) return 1;
    const float pdf = lights.Pdf(path.from, path.ray.d);
    return pdf > 0 ? MisWeight<C>(FindsBy::kHit, path.pdf, pdf) : 1;
  }
}

// Adds the emission along `length` of the path's ray.
template <typename C>
void AddSegmentEmission(const Context<C>& c, double length, PathState<C>* path) {
  const MediumProperties<typename C::Color>& properties = path->media.properties;
  if (properties.emission.IsBlack() && !properties.has_emissive_grid) return;
  typename C::Color arriving = path->throughput * [&] {
    if constexpr (C::kHeterogeneous) {
      if (properties.is_heterogeneous) {
        return EmissionHeterogeneous(
            c, path->ray, c.sampler.Get4(Slot(NextVertexIndex(*path), VertexSlot::kMedium)),
            path->null_crossings, length, *path, path->media);
      }
    }
    return EmissionAlong(properties, length);
  }();
  if constexpr (C::kSamplesEmission || C::kBothEnds) arriving *= EmissionHitWeight(c, *path);
  AddVolumeEmission(c, arriving, path);
}

// Samples a direction from the vertex towards emissive media and adds the emission along it.
template <typename C, typename Vertex>
void SampleVolumeEmission(const Context<C>& c, const Vertex& vertex, PathState<C>* path) {
  using Color = typename C::Color;
  if (!c.scene.media || c.scene.media->emissive_volumes().empty() || !SamplesEmission(c)) return;
  const EmissiveVolumeSampler& lights = c.scene.media->emissive_volumes();
  const std::array<float, 4> u = c.sampler.Get4(EmissionSlot(LastVertexIndex(*path)));
  const SurfacePoint& point = vertex.point;
  const EmissiveVolumeSampler::Sample sample = lights.SampleFrom(point.p, u);
  if (!(sample.pdf > 0)) return;
  const BsdfValueOf<Color> value = vertex.Eval(sample.w);
  if (value.f_cos.IsBlack()) return;
  MediumState<C> media = path->media;
  if (!vertex.EnterSide(c, sample.w, *path, &media)) return;
  Ray ray;
  ray.time = path->ray.time;
  Leave(point, sample.w, &ray);
  ray.d = sample.w;
  if constexpr (C::kRayKinds) ray.mask = kShadowRay;
  Color sum;
  [[maybe_unused]] Color not_reached;  // By light paths.
  const auto add = [&](const Ray& segment, uint32_t crossing, double length,
                       const Color& transmittance, const MediumState<C>& in) {
    if (in.properties.emission.IsBlack() && !in.properties.has_emissive_grid) return;
    const Color arriving =
        transmittance * (in.properties.is_heterogeneous
                             ? EmissionHeterogeneous(c, segment, u, crossing, length, *path, in)
                             : EmissionAlong(in.properties, length));
    if constexpr (C::kBothEnds) {
      if (!c.scene.media->BeginsLightPaths(in.set)) {
        not_reached += arriving;
        return;
      }
    }
    sum += arriving;
  };
  TraceTransmittance(c, ray, nullptr, {u[3], u[2]}, *path, std::move(media), add);
  const float weight = MisWeight<C>(FindsBy::kLightSample, sample.pdf, value.pdf);
  if constexpr (C::kBothEnds) {
    const float shared = MediaSampleWeightBesideLight(
        c, vertex, sample.w, static_cast<double>(sample.pdf), value.pdf, *path);
    sum = sum * shared + not_reached * weight;
    AddVolumeEmission(c, path->throughput * value.f_cos * sum * (1 / sample.pdf), path);
    return;
  }
  AddVolumeEmission(c, path->throughput * value.f_cos * sum * (weight / sample.pdf), path);
}

}  // namespace sheaf::render
