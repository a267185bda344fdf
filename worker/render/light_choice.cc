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
// Where lights are chosen by power: the even share, and the least share of infinite lights together
// and of local lights together when there are both.
constexpr double kEvenShareByPower = 0.1;
constexpr double kGroupShareMin = 0.1;
// Keeps sums of weights finite next to a point light.
constexpr float kWeightMax = 1e30f;
constexpr float kCoordinateError = 0x1p-21f;

// An estimate of the unoccluded irradiance at p on a plane that faces the light. 0 only for lights
// that emit nothing and where a one-sided planar light certainly faces away.
float WeightAt(const LightBounds& light, Vec3f p) {
  if (!(light.strength > 0)) return 0;
  if (light.kind == LightBounds::Kind::kInfinite) return std::min(light.strength, kWeightMax);
  const Vec3f to_p = p - light.center;
  const float d_squared = LengthSquared(to_p);
  if (light.kind == LightBounds::Kind::kPoint) {
    return d_squared > 0 ? std::min(light.strength / d_squared, kWeightMax) : kWeightMax;
  }
  // Far away area / distance^2, close by at most a hemisphere.
  constexpr float kInverseTwoPi = static_cast<float>(1 / (2 * kPi));
  float solid_angle = light.area / (d_squared + light.area * kInverseTwoPi);
  if (light.kind == LightBounds::Kind::kPlanar) {
    const float height = Dot(light.normal, to_p);
    const Vec3f reach{std::fabs(p.x) + std::fabs(light.center.x),
                      std::fabs(p.y) + std::fabs(light.center.y),
                      std::fabs(p.z) + std::fabs(light.center.z)};
    const float error = kCoordinateError * (reach.x + reach.y + reach.z);
    if (!light.two_sided && height < -error) return 0;
    // The greatest cosine any part of the light can show.
    const float rise = std::fabs(height) + light.radius;
    if (rise * rise < d_squared) solid_angle *= rise / std::sqrt(d_squared);
  }
  return std::min(std::max(light.strength * solid_angle, 1e-30f), kWeightMax);
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

LightChoice::LightChoice(std::vector<LightBounds> lights, float scene_radius)
    : lights_(std::move(lights)) {
  if (lights_.size() > kLightsWeighedMax) BuildByPower(scene_radius);
}

void LightChoice::BuildByPower(float scene_radius) {
  // Power over pi; an infinite light's is what falls on a disk as large as the scene.
  std::vector<double> power(lights_.size());
  double infinite_power = 0, local_power = 0;
  for (size_t i = 0; i < lights_.size(); ++i) {
    const LightBounds& light = lights_[i];
    const double strength = static_cast<double>(light.strength);
    switch (light.kind) {
      case LightBounds::Kind::kPlanar:
        power[i] = strength * static_cast<double>(light.area) * (light.two_sided ? 2 : 1);
        break;
      case LightBounds::Kind::kSphere:
        power[i] = 4 * strength * static_cast<double>(light.area);
        break;
      case LightBounds::Kind::kPoint:
        power[i] = 4 * strength;
        break;
      case LightBounds::Kind::kInfinite:
        power[i] = strength * static_cast<double>(scene_radius) * static_cast<double>(scene_radius);
        break;
    }
    (light.kind == LightBounds::Kind::kInfinite ? infinite_power : local_power) += power[i];
  }
  const double total = infinite_power + local_power;
  const double infinite_share =
      infinite_power > 0 && local_power > 0
          ? std::clamp(infinite_power / total, kGroupShareMin, 1 - kGroupShareMin)
          : (infinite_power > 0 ? 1.0 : 0.0);
  size_t positive_count = 0;
  for (const LightBounds& light : lights_) positive_count += light.strength > 0;
  if (positive_count == 0) return;
  const double even = kEvenShareByPower / static_cast<double>(positive_count);
  for (size_t i = 0; i < lights_.size(); ++i) {
    const bool infinite = lights_[i].kind == LightBounds::Kind::kInfinite;
    const double group = infinite ? infinite_power : local_power;
    const double share = infinite ? infinite_share : 1 - infinite_share;
    if (!(lights_[i].strength > 0)) continue;
    power[i] = even + (group > 0 ? (1 - kEvenShareByPower) * share * (power[i] / group) : 0);
  }
  by_power_ = DiscreteDistribution(power);
}

LightChoice::Weights LightChoice::Weigh(Vec3f p) const {
  Weights w;
  float sum = 0;
  int positive_count = 0;
  for (size_t i = 0; i < lights_.size(); ++i) {
    w.weight[i] = WeightAt(lights_[i], p);
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

std::optional<ChosenLight> LightChoice::Choose(Vec3f p, float u, uint64_t salt) const {
  if (lights_.size() == 1) return ChosenLight{0, 1};
  if (lights_.size() > kLightsWeighedMax) {
    if (by_power_.empty()) return std::nullopt;
    const size_t light = by_power_.Sample(ExtendBits(u, salt));
    return ChosenLight{static_cast<uint32_t>(light),
                       static_cast<float>(by_power_.Probability(light))};
  }
  const Weights w = Weigh(p);
  std::optional<ChosenLight> chosen;
  // Where rounding leaves the sum below u, the last light that may be chosen stands.
  float begin = 0;
  for (size_t i = 0; i < lights_.size(); ++i) {
    const float probability = w.Probability(i);
    if (!(probability > 0)) continue;
    chosen = ChosenLight{static_cast<uint32_t>(i), probability};
    begin += probability;
    if (u < begin) break;
  }
  return chosen;
}

float LightChoice::Probability(uint32_t light, Vec3f p) const {
  if (lights_.size() == 1) return 1;
  if (lights_.size() > kLightsWeighedMax) {
    if (by_power_.empty()) return 0;
    return static_cast<float>(by_power_.Probability(light));
  }
  return Weigh(p).Probability(light);
}

}  // namespace sheaf::render
