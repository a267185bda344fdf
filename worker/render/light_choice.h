// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightChoice: which light to sample at a point, and with what probability. A scene of few lights
// is weighed light by light at every point, by an estimate of the unoccluded light that arrives; a
// scene of many is chosen from by power. Either way a share goes to all lights alike, so that a
// wrong estimate (a shadow, a narrow lobe) costs efficiency and never the picture, and a light has
// probability 0 only where it certainly sends nothing. One light alone has probability 1 exactly.
// Every estimate is a ratio of like quantities: nothing changes with the scene's unit of length.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/discrete_distribution.h"

namespace sheaf::render {

// Up to this many lights are weighed at every point.
inline constexpr size_t kLightsWeighedMax = 16;

// What choosing needs to know of one light. Space: render.
struct LightBounds {
  enum class Kind : uint8_t { kPlanar, kSphere, kPoint, kInfinite };
  Kind kind = Kind::kInfinite;
  bool two_sided = true;  // kPlanar: emits on both sides.
  Vec3f center{};
  Vec3f normal{};    // kPlanar: unit, on the emitting side.
  float radius = 0;  // Of a sphere about center that holds the light.
  float area = 0;    // kPlanar: the shape's; kSphere: of its outline; else 0.
  // kPlanar, kSphere: |radiance|; kPoint: |intensity|; kInfinite: the most |irradiance| it can
  // give. In luminance.
  float strength = 0;
};

struct ChosenLight {
  uint32_t light = 0;
  float probability = 0;
};

class LightChoice {
 public:
  LightChoice() = default;
  // scene_radius: how far apart things are, to balance infinite lights against local ones where
  // lights are chosen by power.
  LightChoice(std::vector<LightBounds> lights, float scene_radius);

  // A light as seen from p, none where no light reaches p. salt: bits independent of u (SaltOf).
  std::optional<ChosenLight> Choose(Vec3f p, float u, uint64_t salt) const;
  // The probability with which Choose returns the light at p: the same bits.
  float Probability(uint32_t light, Vec3f p) const;

 private:
  struct Weights;
  Weights Weigh(Vec3f p) const;
  void BuildByPower(float scene_radius);

  std::vector<LightBounds> lights_;
  DiscreteDistribution by_power_;  // Where there are more than kLightsWeighedMax.
};

}  // namespace sheaf::render
