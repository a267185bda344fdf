// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/scene/chain_seeds.h"

#include <algorithm>
#include <tuple>
#include <utility>

#include "common/base/check.h"

namespace sheaf::render {

const ChainSeeds::OfCaster* ChainSeeds::OfLamp::Of(uint32_t caster) const {
  const auto at = std::ranges::lower_bound(casters, caster, {}, &OfCaster::caster);
  return at == casters.end() || at->caster != caster ? nullptr : &*at;
}

const ChainSeeds::OfLamp* ChainSeeds::Of(int32_t lamp) const {
  const auto at = std::ranges::lower_bound(lamps_, lamp, {}, &OfLamp::lamp);
  return at == lamps_.end() || at->lamp != lamp ? nullptr : &*at;
}

NearestPoints ChainSeeds::PointsOf(uint32_t first, uint32_t end) const {
  std::vector<NearestPoints::Item> items;
  items.reserve(end - first);
  for (uint32_t i = first; i < end; ++i) items.push_back({seeds_[i].at, i});
  return NearestPoints(std::move(items));
}

template <typename IsAlike>
uint32_t ChainSeeds::EndOf(uint32_t first, const IsAlike& is_alike) const {
  uint32_t end = first + 1;
  while (end < size() && is_alike(seeds_[first], seeds_[end])) ++end;
  return end;
}

ChainSeeds::ChainSeeds(std::vector<ChainSeed> seeds) : seeds_(std::move(seeds)) {
  SHEAF_CHECK(seeds_.size() <= kChainSeedsMax);
  const auto lamp = [](const ChainSeed& s) { return s.lamp; };
  const auto caster = [](const ChainSeed& s) { return std::tuple(s.lamp, s.caster); };
  const auto type = [](const ChainSeed& s) { return std::tuple(s.lamp, s.caster, s.type); };
  const auto alike = [](const auto& key) {
    return [&key](const ChainSeed& a, const ChainSeed& b) { return key(a) == key(b); };
  };
  std::ranges::stable_sort(seeds_, {}, type);
  for (uint32_t i = 0; i < size();) {
    const uint32_t lamp_end = EndOf(i, alike(lamp));
    OfLamp of_lamp{.lamp = seeds_[i].lamp, .all = PointsOf(i, lamp_end)};
    while (i < lamp_end) {
      const uint32_t caster_end = EndOf(i, alike(caster));
      OfCaster of_caster{.caster = seeds_[i].caster, .all = PointsOf(i, caster_end)};
      while (i < caster_end) {
        const uint32_t type_end = EndOf(i, alike(type));
        of_caster.types.push_back(PointsOf(i, type_end));
        i = type_end;
      }
      of_lamp.casters.push_back(std::move(of_caster));
    }
    lamps_.push_back(std::move(of_lamp));
  }
}

}  // namespace sheaf::render
