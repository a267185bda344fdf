// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ChainSearch: draws chains of smooth interfaces from a vertex to a point of a lamp (chains.h). A
// draw traces a seed, and changes it by Newton's method until it meets the point. Sources: Zeltner,
// Georgiev and Jakob 2020, "Specular Manifold Sampling"; Jhang and Chang 2024, "Photon-Driven
// Manifold Sampling".
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "worker/render/chains/chain_trace.h"
#include "worker/render/chains/seed_paths.h"
#include "worker/render/sampling/event_stream.h"

namespace sheaf::render {

// Chains traced in a walk.
inline constexpr uint32_t kWalkTracesMax = 16;
// A walk ends where its next step would move the first interface by less than this part of the
// caster's radius; and chains are the same whose first interfaces are as near as that.
inline constexpr double kWalkTolerance = 1e-5, kSameChain = 1e-4;
// Steps are halved down to this part.
inline constexpr double kWalkPartMin = 1.0 / 64;
// The parts of draws that begin where light paths have left the caster: all together, and of a type
// that is chosen evenly. The others begin anywhere.
inline constexpr double kNearPart = 0.5, kNearOfTypePart = 0.25;
// Seeds that a vertex draws from.
inline constexpr uint32_t kNearSeedsMax = 12;

// The search for chains from a vertex through one caster to a point of a lamp. Its draws are
// independent and distributed alike.
template <typename C>
class ChainSearch {
 public:
  // All must outlive *this. path: at the vertex. seeds: of the caster; may be null.
  ChainSearch(const Context<C>& c, const SurfaceVertex<C>& vertex, const PathState<C>& path,
              Vec3d lamp, uint32_t caster, const ChainSeeds::OfCaster* seeds)
      : c_(c),
        vertex_(vertex),
        path_(path),
        lamp_(lamp),
        x_(ToDouble(vertex.point.p)),
        caster_(caster),
        interfaces_max_(std::min<uint32_t>(
            kChainInterfacesMax, static_cast<uint32_t>(c.scene.settings.max_depth) - path.depth)),
        seeds_(seeds) {
    if (seeds != nullptr) near_.resize(1 + seeds->types.size());
  }

  // Most draws find none.
  std::optional<Chain> Draw(EventStream* events) {
    const std::optional<Chain> seed = Seed(nullptr, events);
    return seed ? Walk(*seed) : std::nullopt;
  }
  // Whether a further draw finds the same chain.
  bool DrawsAgain(const Chain& found, EventStream* events) {
    const std::optional<Chain> seed = Seed(&found.type, events);
    if (!seed || !(seed->type == found.type)) return false;  // Walks keep the type.
    const std::optional<Chain> again = Walk(*seed);
    return again && Length(again->first - found.first) <= kSameChain * Radius();
  }

 private:
  // The seeds nearest to the vertex.
  struct Near {
    bool is_known = false;
    uint32_t count = 0;
    std::array<uint32_t, kNearSeedsMax> seeds{};
  };

  double Radius() const { return c_.scene.chains->RadiusOf(caster_); }

  // A chain by chance. type: if not null, any chain of another type may be none.
  std::optional<Chain> Seed(const ChainType* type, EventStream* events) {
    if (seeds_ == nullptr) return SeedAnywhere(events);
    const double part = events->Uniform();
    if (part < kNearPart) return SeedNear(0, type, events);
    if (part >= kNearPart + kNearOfTypePart) return SeedAnywhere(events);
    return SeedNear(
        1 + static_cast<size_t>(events->Uniform() * static_cast<double>(seeds_->types.size())),
        type, events);
  }

  // The chain that begins like one of the light paths nearby. set: 0 for all, else of a type.
  std::optional<Chain> SeedNear(size_t set, const ChainType* type, EventStream* events) {
    Near& near = near_[set];
    if (!near.is_known) {
      const NearestPoints& points = set == 0 ? seeds_->all : seeds_->types[set - 1];
      near.count = points.Find(vertex_.point.p, near.seeds);
      near.is_known = true;
    }
    const auto draw = [&]() -> const ChainSeed& {
      const auto i = static_cast<size_t>(events->Uniform() * static_cast<double>(near.count));
      return (*c_.scene.chains->seeds())[near.seeds[i]];
    };
    const ChainSeed& seed = draw();
    // Chains to the vertex begin beside those to its neighbours by about as much as they differ.
    const ChainSeed &one = draw(), &other = draw();
    if (type != nullptr && !(seed.type == *type)) return std::nullopt;
    if (seed.type.count > interfaces_max_) return std::nullopt;
    Vec3d first = ToDouble(seed.first);
    if (one.type == seed.type && other.type == seed.type) {
      first += (ToDouble(one.first) - ToDouble(other.first)) * events->Uniform();
    }
    PathState<C> path = path_;
    Chain chain;
    if (!TraceChain(c_, vertex_, Normalize(first - x_), seed.type, nullptr, &path, &chain)) {
      return std::nullopt;
    }
    return chain;
  }

  // The chain that begins anywhere towards the caster, and ends where it leaves all casters.
  std::optional<Chain> SeedAnywhere(EventStream* events) const {
    const double u[3] = {events->Uniform(), events->Uniform(), events->Uniform()};
    const Vec3d w = c_.scene.chains->SampleDirection(caster_, x_, u);
    PathState<C> path = path_;
    Chain chain;
    if (!LeaveVertex(c_, vertex_, w, &path, &chain)) return std::nullopt;
    // Faint reflections are sought often, since few light paths show them.
    constexpr float kLeast = 0.25f;
    RawHit hit;
    std::optional<SurfaceVertex<C>> at;
    while (chain.type.count < interfaces_max_) {
      if (MeetSurface(c_, nullptr, &path, &hit, &at) != Met::kInterface) break;
      if (!PassInterface(c_, *at, hit, ChanceEvent(kLeast, events), &path, &chain))
        return std::nullopt;
      if (chain.first_shape != c_.scene.chains->ShapeOf(caster_)) return std::nullopt;
    }
    return chain.type.count > 0 ? std::optional(chain) : std::nullopt;
  }

  // The normal of the plane in which misses are measured. Along the last interface they change
  // evenly if the interfaces are flat; not if the ray leaves along it.
  static Vec3d PlaneOf(const Chain& chain) {
    constexpr double kCosineMin = 0.3;
    const double cosine = Dot(chain.ray.d, chain.last_normal);
    return std::fabs(cosine) > kCosineMin ? chain.last_normal : chain.ray.d;
  }

  // The chain of the same type that meets the lamp's point, if Newton's method finds one.
  std::optional<Chain> Walk(Chain chain) const {
    std::optional<ChainMiss> miss = MissOf(chain.ray, lamp_, PlaneOf(chain));
    const ChainType type = chain.type;
    double part = 1;
    for (uint32_t traces = 0; miss;) {
      const std::array<double, 2> step = miss->Step();
      Vec3d move = chain.first_dp[0] * step[0] + chain.first_dp[1] * step[1];
      const double length = Length(move);
      if (length <= kWalkTolerance * Radius()) {
        if (chain.first_shape != c_.scene.chains->ShapeOf(caster_)) break;
        // The step is nearly all that is left of the miss.
        chain.w = Normalize(chain.first + move - x_);
        return chain;
      }
      if (!std::isfinite(length)) return std::nullopt;
      if (length > Radius()) move *= Radius() / length;
      for (;; part *= 0.5) {
        if (part < kWalkPartMin || ++traces > kWalkTracesMax) return std::nullopt;
        const Vec3d w = Normalize(chain.first + move * part - x_);
        PathState<C> path = path_;
        Chain next;
        if (!TraceChain<C>(c_, vertex_, w, type, nullptr, &path, &next)) continue;
        const std::optional<ChainMiss> next_miss = MissOf(next.ray, lamp_, PlaneOf(chain));
        if (!next_miss || !(next_miss->Distance() < miss->Distance())) continue;
        chain = next;
        miss = MissOf(chain.ray, lamp_, PlaneOf(chain));
        break;
      }
      part = std::min(1.0, 2 * part);
    }
    return std::nullopt;
  }

  const Context<C>& c_;
  const SurfaceVertex<C>& vertex_;
  const PathState<C>& path_;
  const Vec3d lamp_, x_;  // The lamp's point, and the vertex.
  const uint32_t caster_, interfaces_max_;
  const ChainSeeds::OfCaster* seeds_;
  std::vector<Near> near_;  // All types together, then each.
};

}  // namespace sheaf::render
