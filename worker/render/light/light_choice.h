// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightChoice: which light to sample at a point, and with what probability. A scene of few lights
// is weighed light by light at every point, by an estimate of the unoccluded light that arrives; a
// scene of many by a hierarchy, a LightTree, with the infinite lights beside it. Either way a share
// is independent of the estimates, so that a wrong one (a shadow, a narrow lobe) costs efficiency
// and never the picture, and a light has probability 0 only where it certainly sends nothing. One
// light alone has probability 1 exactly. Every estimate is a ratio of like quantities: nothing
// changes with the scene's unit of length.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/light/light_bounds.h"
#include "worker/render/light/light_tree.h"
#include "worker/render/sampling/discrete_distribution.h"

namespace sheaf::render {

// Up to this many lights are weighed at every point.
inline constexpr size_t kLightsWeighedMax = 16;

class LightChoice {
 public:
  LightChoice();
  ~LightChoice();
  LightChoice(LightChoice&&) noexcept;
  LightChoice& operator=(LightChoice&&) noexcept;
  explicit LightChoice(std::vector<LightBounds> lights);

  // A light as seen from p, none where no light reaches p. n: unit normal at p on whose side alone
  // light counts, or zero. salt: bits independent of u (SaltOf).
  std::optional<ChosenLight> Choose(Vec3f p, Vec3f n, float u, uint64_t salt) const;
  // The probability with which Choose returns the light at p: the same bits.
  float Probability(uint32_t light, Vec3f p, Vec3f n) const;
  uint64_t memory_bytes() const;

 private:
  struct Weights;
  struct Block;
  Weights Weigh(Vec3f p, Vec3f n) const;
  double InfiniteShare(Vec3f p, Vec3f n) const;
  float ProbabilityInfinite(size_t rank, double share) const;

  size_t count_ = 0;
  // Where there are at most kLightsWeighedMax, those.
  std::vector<Block> blocks_;
  // Where there are more.
  LightTree tree_;
  std::vector<uint32_t> infinite_lights_;  // Ascending, not black.
  DiscreteDistribution infinite_;          // Over infinite_lights_.
  double infinite_irradiance_ = 0;
};

}  // namespace sheaf::render
