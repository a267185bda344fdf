// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Chains: light of small lamps that reaches a rough vertex on a surface through one to
// kChainInterfacesMax smooth interfaces, none of which light samples can pass. A chain is sought
// from a random beginning towards a caster: where light paths have left it to places nearby
// (ChainSeeds), or anywhere, with random reflections and refractions until it leaves the casters.
// Its beginning is changed by Newton's method until the chain meets a point that was sampled on a
// lamp. A found chain stands for itself alone, so its light is divided by the probability with
// which it is found. That is unknown; the number of independent trials until the same chain comes
// again has the inverse as its expectation. Sources: Zeltner, Georgiev and Jakob 2020, "Specular
// Manifold Sampling"; Jakob and Marschner 2012; Booth 2007, "Unbiased Monte Carlo estimation of the
// reciprocal of an integral".
//
// The density of found chains is unknown, too, so they are not weighed against other techniques:
// paths of that kind belong to chains, and scattering that finds them counts nothing
// (IsFoundByChain). A path is of that kind by its vertices alone.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <optional>

#include "worker/render/chains/chain_search.h"
#include "worker/render/chains/seed_paths.h"
#include "worker/render/sampling/event_stream.h"

namespace sheaf::render {

// Trials after which a found chain is dropped: RayCounts::capped_chains.
inline constexpr uint32_t kChainTrialsMax = 1u << 18;
// The least part of a path's vertices that seek chains, where they matter little to the image; and
// the part of those that the camera sees only by rough surfaces.
inline constexpr double kSeekMin = 0.1, kSeekIndirect = 0.25;
// Found chains that bring less than this part of the light that the lamp would bring directly are
// kept by chance, with kKeepMin or more: they are many, and found so rarely that they would take
// most of the trials.
inline constexpr double kFaintPart = 0.01, kKeepMin = 1.0 / 32;

// In the image.
template <typename C>
double SeenLuminance(const Context<C>& c, const typename C::Color& radiance,
                     const PathState<C>& path) {
  return static_cast<double>(Luminance(c.scene.film.Of(radiance, path.wavelengths)));
}

template <typename Color>
struct ChainLight {
  // The light of a lamp's point that comes along a chain, and that the vertex scatters back along
  // the path, over the pdf of the point; black where something hides it.
  Color radiance;
  LightPathKind kind{};
  // The throughput of the path and the chain, times the ratio of its geometry term to that of the
  // straight line.
  double part = 0;
  // The luminance of a sample that scattering leads along the chain.
  double scattered = 0;
};

template <typename C>
ChainLight<typename C::Color> LightAlong(const Context<C>& c, const SurfaceVertex<C>& vertex,
                                         const Chain& chain, const ChainTable::LampPoint& lamp,
                                         std::array<float, 2> u, PathState<C> path) {
  using Color = typename C::Color;
  const BsdfValueOf<Color> bsdf = vertex.Eval(ToFloat(chain.w));
  if (bsdf.f_cos.IsBlack()) return {};
  Chain traced;
  if (!TraceChain(c, vertex, chain.w, chain.type, &u, &path, &traced)) return {};
  const std::optional<ChainMiss> miss = MissOf(traced.ray, lamp.p, traced.ray.d);
  RawHit hit;
  std::optional<SurfaceVertex<C>> at;
  if (!miss) return {};
  // The rest of the miss must not lead past a lamp that is smaller.
  path.ray.d = ToFloat(Normalize(lamp.p - traced.ray.p));
  if (MeetSurface(c, &u, &path, &hit, &at) == Met::kNothing) return {};
  const SurfacePoint& point = at->point;
  // A sphere is seen from outside.
  if (point.emitter != lamp.emitter || Dot(lamp.outward, traced.ray.d) > 0) return {};
  const Vec3f n = point.EmitterNormal();
  const Color radiance = c.scene.lights->template EmitterRadianceAt<C::kTraits>(
      lamp.emitter, n, -path.ray.d, point.uv, path.wavelengths);
  const double cosine = std::fabs(Dot(traced.ray.d, ToDouble(n)));
  const double scale = cosine / (std::fabs(miss->determinant) * lamp.pdf);
  ChainLight<Color> light;
  light.kind = path.history.KindAtHit();
  light.part = static_cast<double>(MaxComponent(path.throughput)) *
               LengthSquared(lamp.p - ToDouble(vertex.point.p)) / std::fabs(miss->determinant);
  const Color arriving = path.throughput * bsdf.f_cos * radiance;
  light.radiance = arriving * static_cast<float>(scale);
  const double pdf = static_cast<double>(bsdf.pdf) * traced.probability;
  if (pdf > 0) light.scattered = SeenLuminance(c, arriving, path) / pdf;
  return light;
}

template <typename C, typename Vertex>
void SampleChain(const Context<C>& c, const Vertex& vertex, PathState<C>* path) {
  const ChainTable& table = *c.scene.chains;
  if (table.empty() || vertex.in_subsurface) return;
  if (path->depth >= static_cast<uint32_t>(c.scene.settings.max_depth)) return;
  const uint32_t index = LastVertexIndex(*path);
  const std::array<float, 4> u = c.sampler.Get4(ChainSlot(index));
  const std::array<float, 4> key = c.sampler.Get4(ChainKeySlot(index));
  EventStream events({std::bit_cast<uint32_t>(key[0]), std::bit_cast<uint32_t>(key[1]),
                      std::bit_cast<uint32_t>(key[2]), std::bit_cast<uint32_t>(key[3])});
  const double seek = std::clamp(
      static_cast<double>(MaxComponent(path->throughput)) * (path->specular ? 1 : kSeekIndirect),
      kSeekMin, 1.0);
  if (!(events.Uniform() < seek)) return;
  const ChainTable::LampPoint lamp = table.SampleLamp(u[2], {u[0], u[1]});
  const ChainSeeds::OfLamp* seeds = table.seeds()->Of(lamp.shape);
  const std::optional<ChainTable::ChosenCaster> chosen = table.ChooseCaster(
      vertex.point.p, ToDouble(vertex.light_hint), seeds, static_cast<double>(u[3]));
  if (!chosen) return;
  ChainSearch<C> search(c, vertex, *path, lamp.p, chosen->caster,
                        seeds == nullptr ? nullptr : seeds->Of(chosen->caster));
  const std::optional<Chain> found = search.Draw(&events);
  if (!found) return;
  const ChainLight<typename C::Color> light =
      LightAlong(c, vertex, *found, lamp, {key[0], key[1]}, *path);
  if (light.radiance.IsBlack()) return;
  const double keep = std::clamp(light.part / kFaintPart, kKeepMin, 1.0);
  if (!(events.Uniform() < keep)) return;
  ++c.counts.chains;
  for (uint32_t trials = 1; trials <= kChainTrialsMax; ++trials) {
    ++c.counts.chain_trials;
    if (!search.DrawsAgain(*found, &events)) continue;
    const double scale = trials / (chosen->probability * seek * keep);
    const typename C::Color radiance = light.radiance * static_cast<float>(scale);
    AddLight(c, lamp.emitter, light.kind, radiance, path);
    const double moment = SeenLuminance(c, radiance, *path) * light.scattered;
    c.counts.chain_moment += moment;
    if (!path->chain.is_scattered && path->depth > 1) c.counts.unconnected_chain_moment += moment;
    return;
  }
  ++c.counts.capped_chains;
  c.counts.capped_shape = std::min(c.counts.capped_shape, static_cast<uint32_t>(lamp.shape));
}

template <typename C>
bool IsFoundByChain(const Context<C>& c, uint32_t emitter, const PathState<C>& path) {
  return path.specular && path.chain.is_open && path.chain.interfaces > 0 &&
         path.chain.interfaces <= kChainInterfacesMax && c.scene.chains->IsLamp(emitter);
}

template <typename C, typename Vertex>
void NoteChainScattering(const Context<C>& c, const Vertex& vertex, uint8_t flags,
                         PathState<C>* path) {
  ChainState& chain = path->chain;
  if ((flags & kBsdfSpecular) == 0) {
    chain = {.is_open = !vertex.in_subsurface, .is_scattered = true};
  } else if (chain.is_open && (flags & kBsdfRotated) == 0 && IsInterface(c, vertex) &&
             chain.interfaces < kChainInterfacesMax) {
    ++chain.interfaces;
  } else {
    chain.Close();
  }
}

}  // namespace sheaf::render
