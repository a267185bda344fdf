// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light_choice.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "common/math/elementary.h"

namespace sheaf::render {
namespace {

// Share of the probability that is spread evenly over all lights that may reach a point.
constexpr float kEvenShare = 0.25f;
// The least share of infinite lights together and of local ones together where there are both.
constexpr double kGroupShareMin = 0.1;
// Keeps sums of weights finite next to a point light.
constexpr float kWeightMax = 1e30f;
constexpr float kCoordinateError = 0x1p-21f;
// What cosines of unit vectors of floats may be off by.
constexpr float kCosineError = 0x1p-20f;
constexpr double kBelowOne = 1 - 0x1p-53;

// Whether a light with a normal certainly sends nothing to p.
bool FacesAway(const LightBounds& light, Vec3f to_p, float error) {
  const float height = Dot(light.normal, to_p);
  if (light.kind == LightBounds::Kind::kPlanar) return !light.two_sided && height < -error;
  return light.kind == LightBounds::Kind::kPoint && light.cos_end > 0 &&
         height + error < (light.cos_end - kCosineError) * Length(to_p);
}

// An estimate of the unoccluded irradiance at p on a plane of normal n, or on one that faces the
// light. 0 only for lights that emit nothing, and where they certainly face away or are behind p.
float WeightAt(const LightBounds& light, Vec3f p, Vec3f n) {
  if (!(light.strength > 0)) return 0;
  if (light.kind == LightBounds::Kind::kInfinite) return std::min(light.strength, kWeightMax);
  const Vec3f to_p = p - light.center;
  const float d_squared = LengthSquared(to_p);
  const Vec3f reach{std::fabs(p.x) + std::fabs(light.center.x),
                    std::fabs(p.y) + std::fabs(light.center.y),
                    std::fabs(p.z) + std::fabs(light.center.z)};
  const float error = kCoordinateError * (reach.x + reach.y + reach.z);
  if (FacesAway(light, to_p, error)) return 0;
  // The greatest height any part of the light can have over the horizon.
  const float rise = light.radius + error - Dot(n, to_p);
  if (rise < 0) return 0;
  float weight = 0;
  if (light.kind == LightBounds::Kind::kPoint) {
    weight = d_squared > 0 ? light.strength / d_squared : kWeightMax;
  } else {
    // Far away area / distance^2, close by at most a hemisphere.
    constexpr float kInverseTwoPi = static_cast<float>(1 / (2 * kPi));
    weight = light.strength * light.area / (d_squared + light.area * kInverseTwoPi);
  }
  if (light.kind == LightBounds::Kind::kPlanar) {
    // The greatest cosine any part of the light can show.
    const float height = std::fabs(Dot(light.normal, to_p)) + light.radius;
    if (height * height < d_squared) weight *= height / std::sqrt(d_squared);
  }
  if (n != Vec3f{} && rise * rise < d_squared) weight *= rise / std::sqrt(d_squared);
  return std::min(std::max(weight, 1e-30f), kWeightMax);
}

}  // namespace

struct LightChoice::Weights {
  std::array<float, kLightsWeighedMax> weight{};
  float scale = 0;  // Of weights, to their share of the probability.
  float even = 0;   // Added for every light of positive weight.

  float Probability(size_t light) const {
    return weight[light] > 0 ? weight[light] * scale + even : 0;
  }
};

LightChoice::LightChoice(std::vector<LightBounds> lights) : count_(lights.size()) {
  if (count_ <= kLightsWeighedMax) {
    weighed_ = std::move(lights);
    return;
  }
  std::vector<double> irradiances;
  for (uint32_t i = 0; i < lights.size(); ++i) {
    const float irradiance = lights[i].strength;
    if (lights[i].kind != LightBounds::Kind::kInfinite) continue;
    if (!(irradiance > 0 && std::isfinite(irradiance))) continue;
    infinite_lights_.push_back(i);
    irradiances.push_back(static_cast<double>(irradiance));
    infinite_irradiance_ += irradiances.back();
  }
  infinite_ = DiscreteDistribution(irradiances);
  tree_ = LightTree(lights);
}

LightChoice::Weights LightChoice::Weigh(Vec3f p, Vec3f n) const {
  Weights w;
  float sum = 0;
  int positive_count = 0;
  for (size_t i = 0; i < weighed_.size(); ++i) {
    w.weight[i] = WeightAt(weighed_[i], p, n);
    sum += w.weight[i];
    positive_count += w.weight[i] > 0;
  }
  if (positive_count == 0) return w;
  if (positive_count == 1) {
    w.even = 1;
    return w;
  }
  w.scale = (1 - kEvenShare) / sum;
  w.even = kEvenShare / static_cast<float>(positive_count);
  return w;
}

// By how much each group may send to p.
double LightChoice::InfiniteShare(Vec3f p, Vec3f n) const {
  if (infinite_lights_.empty()) return 0;
  const double local_irradiance = tree_.empty() ? 0 : tree_.Irradiance(p, n);
  if (!(local_irradiance > 0)) return 1;
  return std::clamp(infinite_irradiance_ / (infinite_irradiance_ + local_irradiance),
                    kGroupShareMin, 1 - kGroupShareMin);
}

float LightChoice::ProbabilityInfinite(size_t rank, double share) const {
  return static_cast<float>(share * infinite_.Probability(rank));
}

std::optional<ChosenLight> LightChoice::Choose(Vec3f p, Vec3f n, float u, uint64_t salt) const {
  if (count_ == 1) return ChosenLight{0, 1};
  if (count_ > kLightsWeighedMax) {
    const double infinite_share = InfiniteShare(p, n);
    const double x = ExtendBits(u, salt);
    if (x < infinite_share) {
      const size_t rank = infinite_.Sample(std::min(x / infinite_share, kBelowOne));
      return ChosenLight{infinite_lights_[rank], ProbabilityInfinite(rank, infinite_share)};
    }
    if (tree_.empty()) return std::nullopt;
    const double local_share = 1 - infinite_share;
    std::optional<ChosenLight> chosen =
        tree_.Choose(p, n, std::min((x - infinite_share) / local_share, kBelowOne));
    if (chosen) chosen->probability *= static_cast<float>(local_share);
    return chosen;
  }
  const Weights w = Weigh(p, n);
  std::optional<ChosenLight> chosen;
  // Where rounding leaves the sum below u, the last light that may be chosen stands.
  float begin = 0;
  for (size_t i = 0; i < weighed_.size(); ++i) {
    const float probability = w.Probability(i);
    if (!(probability > 0)) continue;
    chosen = ChosenLight{static_cast<uint32_t>(i), probability};
    begin += probability;
    if (u < begin) break;
  }
  return chosen;
}

float LightChoice::Probability(uint32_t light, Vec3f p, Vec3f n) const {
  if (count_ == 1) return 1;
  if (count_ <= kLightsWeighedMax) return Weigh(p, n).Probability(light);
  const double infinite_share = InfiniteShare(p, n);
  const auto infinite = std::lower_bound(infinite_lights_.begin(), infinite_lights_.end(), light);
  if (infinite != infinite_lights_.end() && *infinite == light) {
    return ProbabilityInfinite(static_cast<size_t>(infinite - infinite_lights_.begin()),
                               infinite_share);
  }
  return tree_.Probability(light, p, n) * static_cast<float>(1 - infinite_share);
}

}  // namespace sheaf::render
