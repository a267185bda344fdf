// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightTree: chooses one of many local lights as seen from a point, in time logarithmic in their
// number. Lights that are close together and face the same way share a node, which stores their
// box, a cone about their normals and the sum of their intensities; a walk from the root descends
// to each child in proportion to an estimate of the light it sends to the point. Source: Conty
// Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting"
// (without the splitting); here nodes have eight children, which are weighted in SIMD, and boxes
// and cones are rounded outwards to a few bits.
//
// Every light that may illuminate p has a positive probability: bounds err on the side of more
// light, and a fraction of the walks (kIntensityProbability) follows the intensities alone, so no
// light is less likely than kIntensityProbability times its fraction of the total intensity,
// however wrong the estimates are. Results are bit-identical where the unit of length or of light
// changes by a power of two.
//
// Regions of space may have learned which children of the first nodes are hidden from them
// (LightVisibility): a walk that follows the estimates multiplies them by the learned factors.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "worker/render/light/light_bounds.h"
#include "worker/render/light/light_visibility_row.h"

namespace sheaf::render {

class LightTree {
 public:
  static constexpr size_t kWidth = 8;
  // Upper bound of the steps of a walk, for any set of lights.
  static constexpr int kDepthMax = 48;
  static constexpr size_t kLightsMax = size_t{1} << 28;
  // Fraction of the walks that follow the intensities alone.
  static constexpr double kIntensityProbability = 0.1;
  // Nodes whose children have slots in a LightVisibilityRow: the brightest ones, from the root
  // down.
  static constexpr size_t kVisibilityNodesMax = 16;

  LightTree() = default;
  // Excludes infinite lights, lights of strength 0, and lights with non-finite values or farther
  // than 2^60 from the origin. Requires: at most kLightsMax lights. Cost: O(n log n), about 1 s for
  // a million.
  explicit LightTree(const std::vector<LightBounds>& lights);

  bool empty() const { return nodes_.empty(); }

  // In all of these, n is a unit normal at p, or zero to accept light from all directions. Lights
  // behind n do not count. row: of the region of p, for this tree's slots, not null. Row:
  // LightVisibilityRow or NoLightVisibilityRow.

  // A rough estimate of the unoccluded irradiance at p. 0 only where certainly none arrives.
  // Requires: !empty().
  template <typename Row = NoLightVisibilityRow>
  double Irradiance(Vec3f p, Vec3f n, Row row = {}) const;
  // Chooses a light as seen from p; none where Irradiance is 0. Requires: !empty(), u in [0, 1).
  template <typename Row = NoLightVisibilityRow>
  std::optional<ChosenLight> Choose(Vec3f p, Vec3f n, double u, Row row = {}) const;
  // The probability with which Choose returns the light, bit for bit. 0 for excluded lights.
  template <typename Row = NoLightVisibilityRow>
  float Probability(uint32_t light, Vec3f p, Vec3f n, Row row = {}) const;

  size_t visibility_slot_count() const {
    return std::min(nodes_.size(), kVisibilityNodesMax) * kWidth;
  }
  // Whether the slot stands for lights. Requires: slot < visibility_slot_count().
  bool HasVisibilitySlot(size_t slot) const {
    return nodes_[slot / kWidth].intensity[slot % kWidth] > 0;
  }
  // Calls visit(slot) for each slot that the light is in, from its own to the root's.
  template <typename Visit>
  void VisitVisibilitySlots(uint32_t light, const Visit& visit) const {
    for (uint32_t slot = slot_of_light_[light]; slot != kNoSlot;
         slot = nodes_[slot / kWidth].parent) {
      if (slot / kWidth < kVisibilityNodesMax) visit(size_t{slot});
    }
  }

  size_t size_bytes() const {
    return nodes_.size() * sizeof(Node) + slot_of_light_.size() * sizeof(uint32_t);
  }
  // Steps of the longest walk.
  int depth() const { return depth_; }

 private:
  // A child is a light where kLightBit is set, else a node. A slot is node * kWidth + place.
  static constexpr uint32_t kLightBit = uint32_t{1} << 31;
  static constexpr uint32_t kNoSlot = ~uint32_t{0};

  // Bounds of eight children. Places past the last child have intensity 0.
  static constexpr size_t kCacheLineSize = 64;
  struct alignas(kCacheLineSize) Node {
    Vec3f origin, step;         // Box coordinates count steps from the origin, per axis.
    uint32_t parent = kNoSlot;  // The slot of this node in its parent.
    // Two bytes per entry, because processors load pairs of bytes efficiently.
    uint16_t box[3][kWidth] = {};  // Center and, in the high byte, half the width.
    int16_t axis[3][kWidth] = {};  // Axis of the cone about all normals, times kAxisSteps.
    // Cosine and sine of the cone's half-angle, times kAxisSteps.
    int16_t cos_normals[kWidth] = {}, sin_normals[kWidth] = {};
    // Each light emits within this cosine of its normal, times kEmissionSteps; 0 for a half-space.
    // The high byte is 1 where lights also emit along -normal.
    uint16_t emission[kWidth] = {};
    // Length of the mean normal of the lights with cosine falloff, times kMeanSteps. The high byte
    // is the fraction of the intensity that other lights have, in the same unit.
    uint16_t mean[kWidth] = {};
    float intensity[kWidth] = {};  // Sum over the lights, along their normals.
    uint32_t child[kWidth] = {};

    // Fetches all cache lines at once, so that no later read has to wait.
    void Prefetch() const {
      for (size_t i = 0; i < sizeof(Node); i += kCacheLineSize) {
        __builtin_prefetch(reinterpret_cast<const char*>(this) + i);
      }
    }
  };
  static constexpr float kAxisSteps = 32767, kEmissionSteps = 255, kMeanSteps = 255;

  struct Receiver;
  struct Weights;
  struct NodeProbability;
  class Builder;
  static Weights Weigh(const Node& node, const Receiver& receiver);
  template <typename Row>
  Weights WeighNode(uint32_t index, const Receiver& receiver, Row row) const;

  // The root first, parents before children; the first kVisibilityNodesMax are those with slots.
  std::vector<Node> nodes_;
  std::vector<uint32_t> slot_of_light_;  // kNoSlot for excluded lights.
  double irradiance_scale_ = 1;          // Input intensities divided by those in the nodes.
  int depth_ = 0;
};

}  // namespace sheaf::render
