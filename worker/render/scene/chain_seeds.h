// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// ChainSeeds: where light paths from lamps have left the casters of chains, by the places that they
// reached. A chain to such a place begins like the light path ends. Source: Jhang and Chang 2024,
// "Photon-Driven Manifold Sampling".
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/gather/nearest_points.h"

namespace sheaf::render {

// Light paths that are traced for the seeds of a scene; each gives one seed at most.
inline constexpr uint32_t kChainSeedsMax = 1u << 16;
inline constexpr uint32_t kChainInterfacesMax = 4;

// The light is refracted at the interfaces whose bit is set, and reflected at the others.
struct ChainType {
  uint32_t count = 0, refractions = 0;
  friend constexpr auto operator<=>(const ChainType&, const ChainType&) = default;
};

// Space: render.
struct ChainSeed {
  Vec3f at;          // Where the light path arrived.
  Vec3f first;       // Its last interface, which is the first of a chain from there.
  ChainType type{};  // From there.
  uint32_t caster = 0;
  int32_t lamp = -1;  // The shape.
};

// Thread-safe.
class ChainSeeds {
 public:
  // The seeds of one lamp and caster, together and by type.
  struct OfCaster {
    uint32_t caster = 0;
    NearestPoints all{};
    std::vector<NearestPoints> types{};
  };
  struct OfLamp {
    int32_t lamp = -1;
    NearestPoints all{};
    std::vector<OfCaster> casters{};

    // Null where there are none.
    const OfCaster* Of(uint32_t caster) const;
  };
  // id: of a point.
  const ChainSeed& operator[](uint32_t id) const { return seeds_[id]; }
  // Null where there are none.
  const OfLamp* Of(int32_t lamp) const;
  uint32_t size() const { return static_cast<uint32_t>(seeds_.size()); }
  uint64_t memory_bytes() const {
    // Each is in three trees.
    return seeds_.size() * (sizeof(ChainSeed) + 3 * (sizeof(NearestPoints::Item) + 1));
  }

  ChainSeeds() = default;
  // Requires: at most kChainSeedsMax.
  explicit ChainSeeds(std::vector<ChainSeed> seeds);

 private:
  NearestPoints PointsOf(uint32_t first, uint32_t end) const;
  // The end of the seeds from `first` on that are alike. Requires: first < size().
  template <typename IsAlike>
  uint32_t EndOf(uint32_t first, const IsAlike& is_alike) const;

  std::vector<ChainSeed> seeds_;  // By lamp, caster and type.
  std::vector<OfLamp> lamps_;
};

}  // namespace sheaf::render
