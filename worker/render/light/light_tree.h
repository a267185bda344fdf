// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightTree: chooses one of many local lights as seen from a point, in time that grows with the
// logarithm of their number. Lights that are near each other and face the same way share a node,
// which knows their box, a cone about their normals and the sum of their intensities; a walk from
// the root down goes to each child in proportion to an estimate of what its lights send to the
// point. Source: Conty Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive
// Tree Splitting" (without the splitting); here eight children wide, so that all are weighed at
// once, with boxes and cones rounded outwards to a few bits.
//
// The walk never leaves a light that may shine on p without probability: bounds err on the side of
// more light, and a share of the walks follows the intensities alone (kIntensityShare), so that no
// light is less likely than that share of its part in the whole, however wrong the estimates are.
// Nothing changes, to the bit, where the unit of length or of light changes by a power of two.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "worker/render/light/light_bounds.h"

namespace sheaf::render {

class LightTree {
 public:
  static constexpr size_t kWidth = 8;
  // A walk has at most so many steps, whatever the lights are.
  static constexpr int kDepthMax = 48;
  static constexpr size_t kLightsMax = size_t{1} << 28;
  // Of the probability, for walks that follow the intensities alone.
  static constexpr double kIntensityShare = 0.1;

  LightTree() = default;
  // Infinite lights, lights of strength 0, and lights with a value that is not finite or farther
  // off than 2^60 are left out.
  // Requires: at most kLightsMax lights. Cost: O(n log n), about 1 s for a million.
  explicit LightTree(const std::vector<LightBounds>& lights);

  bool empty() const { return nodes_.empty(); }

  // In all of these, n is a unit normal at p on whose side alone light counts, or zero.

  // A rough estimate of the unoccluded irradiance at p. 0 only where certainly none arrives.
  // Requires: !empty().
  double Irradiance(Vec3f p, Vec3f n) const;
  // A light as seen from p; none where Irradiance is 0. Requires: !empty(), u in [0, 1).
  std::optional<ChosenLight> Choose(Vec3f p, Vec3f n, double u) const;
  // The probability with which Choose returns the light: the same bits. 0 for lights left out.
  float Probability(uint32_t light, Vec3f p, Vec3f n) const;

  size_t size_bytes() const {
    return nodes_.size() * sizeof(Node) + slot_of_light_.size() * sizeof(uint32_t);
  }
  // Steps of the longest walk.
  int depth() const { return depth_; }

 private:
  // A child is a light where kLightBit is set, else a node. A slot is node * kWidth + place.
  static constexpr uint32_t kLightBit = uint32_t{1} << 31;
  static constexpr uint32_t kNoSlot = ~uint32_t{0};

  // Bounds of its children. Places past the last child have intensity 0.
  static constexpr size_t kCacheLineSize = 64;
  struct alignas(kCacheLineSize) Node {
    Vec3f origin, step;         // Boxes are counted in steps from the origin, per coordinate.
    uint32_t parent = kNoSlot;  // The slot that leads here.
    // Two bytes each, for processors load pairs of bytes well.
    uint16_t box[3][kWidth] = {};  // Centre and, in the high byte, half the width.
    int16_t axis[3][kWidth] = {};  // Of the cone about all normals, in 1 / kAxisSteps.
    // Of half that cone's angle, in 1 / kAxisSteps.
    int16_t cos_normals[kWidth] = {}, sin_normals[kWidth] = {};
    // Each light shines within this cosine about its normal, in 1 / kEmissionSteps; 0 for a
    // half-space. In the high byte 1 where lights shine along -normal, too.
    uint16_t emission[kWidth] = {};
    // Of lights that shine by the cosine with a normal: length of their mean normal, in
    // 1 / kMeanSteps. In the high byte, in the same unit, what part of the intensity is of others.
    uint16_t mean[kWidth] = {};
    float intensity[kWidth] = {};  // Sum over the lights, along their normals.
    uint32_t child[kWidth] = {};

    // All cache lines at once: what is read late would else be waited for late.
    void Prefetch() const {
      for (size_t i = 0; i < sizeof(Node); i += kCacheLineSize) {
        __builtin_prefetch(reinterpret_cast<const char*>(this) + i);
      }
    }
  };
  static constexpr float kAxisSteps = 32767, kEmissionSteps = 255, kMeanSteps = 255;

  struct Receiver;
  struct Weights;
  struct Share;
  class Builder;
  static Weights Weigh(const Node& node, const Receiver& receiver);

  std::vector<Node> nodes_;              // The root first, parents before children.
  std::vector<uint32_t> slot_of_light_;  // kNoSlot for lights that were left out.
  double irradiance_scale_ = 1;          // Of intensities as they came to those in the nodes.
  int depth_ = 0;
};

}  // namespace sheaf::render
