// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The light paths that leave seeds for chains (ChainSeeds).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <utility>
#include <vector>

#include "worker/render/chains/chain_trace.h"
#include "worker/render/chains/chain_variants.h"
#include "worker/render/integrator/light_start.h"
#include "worker/render/sampling/event_stream.h"

namespace sheaf::render {

// Chooses by chance, by the interface's reflectance: each event that can be has the probability
// `least` or more.
class ChanceEvent {
 public:
  ChanceEvent(float least, EventStream* events) : least_(least), events_(events) {}
  ChainEvent operator()(float reflectance) const {
    const float reflect = reflectance < 1 ? std::clamp(reflectance, least_, 1 - least_) : 1;
    return events_->Uniform() < static_cast<double>(reflect) ? ChainEvent::kReflect
                                                             : ChainEvent::kRefract;
  }

 private:
  const float least_;
  EventStream* events_;
};

// The seed of a light path from a lamp towards a caster, by chance; none where it reaches nothing
// else after 1 to kChainInterfacesMax interfaces.
template <typename C>
std::optional<ChainSeed> TraceSeed(const Context<C>& c, EventStream* events) {
  const ChainTable& table = *c.scene.chains;
  const auto uniform = [events] {
    return std::min(static_cast<float>(events->Uniform()), 0x1.fffffep-1f);
  };
  const float choice = uniform(), lamp_u = uniform(), lamp_v = uniform();
  const ChainTable::LampPoint lamp = table.SampleLamp(choice, {lamp_u, lamp_v});
  const auto caster = static_cast<uint32_t>(events->Uniform() * table.caster_count());
  const double u[3] = {events->Uniform(), events->Uniform(), events->Uniform()};
  const Vec3d w = table.SampleDirection(caster, lamp.p, u);
  if (!IsDirection(w) || Dot(lamp.outward, w) < 0) return std::nullopt;
  PathState<C> path;
  if constexpr (C::kSpectral) path.wavelengths = c.scene.wavelengths.Sample(uniform());
  // Seeds need not be exact: the ray begins in front of the lamp.
  constexpr double kBefore = 1e-5;
  path.ray.o = ToFloat(lamp.p + w * (kBefore * table.RadiusOf(caster)));
  path.ray.d = ToFloat(w);
  if constexpr (C::kMedia) {
    if (!StartInMediaAtLight(c, nullptr, &path)) return std::nullopt;
  }
  Chain chain{.w = w, .ray = ChainRay(lamp.p, w)};
  int32_t last_shape = kNone;
  RawHit hit;
  std::optional<SurfaceVertex<C>> at;
  // About by the light that they bring.
  constexpr float kLeast = 0.05f;
  for (Met met; (met = MeetSurface(c, nullptr, &path, &hit, &at)) != Met::kOther;) {
    if (met == Met::kNothing || chain.type.count == kChainInterfacesMax) return std::nullopt;
    if (!PassInterface(c, *at, hit, ChanceEvent(kLeast, events), &path, &chain))
      return std::nullopt;
    last_shape = at->point.surface->shape;
  }
  const std::optional<uint32_t> last = table.CasterOf(last_shape);
  if (!last || !std::isfinite(LengthSquared(at->point.p))) return std::nullopt;
  ChainType type{.count = chain.type.count};
  for (uint32_t i = 0; i < type.count; ++i) {
    if ((chain.type.refractions >> i & 1u) != 0) type.refractions |= 1u << (type.count - 1 - i);
  }
  return ChainSeed{.at = at->point.p,
                   .first = ToFloat(chain.ray.p),
                   .type = type,
                   .caster = *last,
                   .lamp = lamp.shape};
}

template <TraitBits kTraits>
ChainSeeds TraceSeeds(const CompiledScene& scene) {
  using C = IntegratorConfig<kTraits, const EmbreeScene, DirectLight::kByBoth,
                             PathKind::kCameraWithChains>;
  RayCounts counts;
  const Sampler sampler(scene.settings.seed, 0, 0, 0, false);
  LightGroups<typename C::Color> groups;
  const Context<C> context{.scene = scene,
                           .tracer = *scene.tracer,
                           .sampler = sampler,
                           .counts = counts,
                           .outputs = nullptr,
                           .groups = groups,
                           .guiding = {},
                           .emission = {}};
  std::vector<ChainSeed> seeds;
  for (uint32_t i = 0; i < kChainSeedsMax && !scene.chains->empty(); ++i) {
    constexpr uint32_t kSeedStream = 0x73656564u;
    EventStream events({kSeedStream, 0, 0, i});
    if (const auto seed = TraceSeed(context, &events)) seeds.push_back(*seed);
  }
  return ChainSeeds(std::move(seeds));
}

}  // namespace sheaf::render
