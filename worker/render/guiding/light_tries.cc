// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/guiding/light_tries.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <span>

#include "worker/render/guiding/guiding_statistics.h"

namespace sheaf::render {
namespace {

// In units of kLightTryUnit, rounded to nearest. 0 for what is no number.
uint32_t UnitsOf(double value) {
  if (!(value > 0)) return 0;
  return static_cast<uint32_t>(std::min(value, kLightTryMax) * kLightTryUnit + 0.5);
}

}  // namespace

// Halves the box until few points are in each region.
class LightRegions {
 public:
  explicit LightRegions(const Bounds& box) : box_(box) {}

  void Add(const GuidingPoint& at) { places_.push_back(box_.PlaceOf(at)); }

  GuidingField Make() {
    double values = kLightRegionTries;
    for (;;) {
      GuidingField field(box_.lower_, box_.upper_);
      if (Halve(places_, 0, 0, values, &field)) return field;
      values *= kGuidingThresholdGrowth;
    }
  }

 private:
  using Place = GuidingField::Place;

  // Recurses to at most kGuidingSpaceDepthMax. False if there are too many regions.
  static bool Halve(std::span<Place> places, uint32_t node, int depth, double values,
                    GuidingField* field) {
    if (static_cast<double>(places.size()) <= values || depth == kGuidingSpaceDepthMax) {
      if (field->regions_.size() == kGuidingRegionsMax) return false;
      field->SetRegion(node, GuidingRegion());
      return true;
    }
    const auto second = std::partition(places.begin(), places.end(), [&](const Place& place) {
      return field->HalfOf(place, depth) == 0;
    });
    const auto middle = static_cast<size_t>(second - places.begin());
    const uint32_t first = field->Halve(node);
    return Halve(places.first(middle), first, depth + 1, values, field) &&
           Halve(places.subspan(middle), first + 1, depth + 1, values, field);
  }

  const GuidingField box_;
  std::vector<Place> places_;
};

void LightTries::Add(const TriedLight& tried) {
  const Vec3f p = tried.from.p, n = tried.from.n;
  const LightChoice::Estimate estimate = choice_.EstimateOf(tried.light, p, n);
  Located located{tried.from, {}};
  located.what.light = tried.light;
  located.what.is_visible = tried.is_visible;
  if (estimate.probability > 0) {
    located.what.estimate = UnitsOf(estimate.share / estimate.probability);
  }
  if (estimate.all > 0) located.what.contribution = UnitsOf(tried.contribution / estimate.all);
  // Any shard will do: this keeps threads apart.
  const uint32_t bits = std::bit_cast<uint32_t>(p.x) ^ std::bit_cast<uint32_t>(p.y) >> 7;
  Shard& shard = shards_[(bits * 0x9e3779b9u) >> 28];
  const MutexLock lock(&shard.mutex);
  shard.tries.push_back(located);
}

template <typename Visit>
void LightTries::ForEach(const Visit& visit) const {
  for (const Shard& shard : shards_) {
    const MutexLock lock(&shard.mutex);
    for (const Located& located : shard.tries) visit(located);
  }
}

size_t LightTries::size() const {
  size_t size = 0;
  for (const Shard& shard : shards_) {
    const MutexLock lock(&shard.mutex);
    size += shard.tries.size();
  }
  return size;
}

GuidingField LightTries::MakeRegions(const Bounds& box) const {
  LightRegions regions(box);
  ForEach([&](const Located& located) { regions.Add(located.from); });
  return regions.Make();
}

LightVisibility LightTries::Learn(const GuidingField& regions) const {
  std::vector<LightTry> tries;
  tries.reserve(size());
  ForEach([&](const Located& located) {
    tries.push_back(located.what);
    tries.back().region = regions.RegionIndexAt(located.from);
  });
  return LearnLightRows(choice_, static_cast<uint32_t>(regions.region_count()), std::move(tries));
}

}  // namespace sheaf::render
