// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The steps of a walk down a LightTree. Internal to light_tree.cc and light_cut.cc.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "common/base/check.h"
#include "common/math/lanes.h"
#include "worker/render/light/choice/light_tree.h"

namespace sheaf::render {

// The inputs of the estimates that depend on the point.
struct LightTree::Receiver {
  Receiver(Vec3f point, Vec3f normal)
      : p(point),
        n(normal),
        n_abs{std::fabs(n.x), std::fabs(n.y), std::fabs(n.z)},
        reach(std::fabs(p.x) + std::fabs(p.y) + std::fabs(p.z)),
        unhinted(n == Vec3f{} ? 1.0f : 0.0f) {}

  Vec3f p, n, n_abs;
  float reach;
  float unhinted;  // 1 where there is no normal: lower bound of the receiver's cosine.
};

// The probability of a node during descent, as two parts: from walks that follow the estimates, and
// from walks that follow intensities. Carrying both is the same as choosing between the two kinds
// of walk before the descent. A node's interval of [0, 1) has the length of their sum, and its
// children's intervals begin where it begins.
struct LightTree::NodeProbability {
  double by_weight = 1 - kIntensityProbability, by_intensity = kIntensityProbability;

  double Sum() const { return by_weight + by_intensity; }
  // The parts of a node's children. Where no child receives a weight, which the node's own coarser
  // bounds could not predict, intensities decide.
  struct PerChild {
    Weights weights;
    double weight_scale, intensity_scale;

    NodeProbability Of(size_t place) const {
      const double intensity = static_cast<double>(weights.intensity[place]);
      const double weight =
          weights.sum > 0 ? static_cast<double>(weights.of_child[place]) : intensity;
      return {weight * weight_scale, intensity * intensity_scale};
    }
  };
  PerChild Among(const Weights& weights) const {
    return {weights,
            by_weight / static_cast<double>(weights.sum > 0 ? weights.sum : weights.intensity_sum),
            by_intensity / static_cast<double>(weights.intensity_sum)};
  }
};

// The slots from a light up to the root.
struct LightTree::SlotPath {
  std::array<uint32_t, kDepthMax> slots;
  size_t count = 0;
};

inline LightTree::SlotPath LightTree::PathTo(uint32_t light) const {
  SlotPath path;
  for (uint32_t slot = slot_of_light_[light]; slot != kNoSlot;
       slot = nodes_[slot / kWidth].parent) {
    SHEAF_DCHECK(path.count < path.slots.size());
    path.slots[path.count++] = slot;
  }
  return path;
}

// Only the estimates are learned: no child's becomes 0.
template <typename Row>
inline LightTree::Weights LightTree::WeighNode(uint32_t index, const Receiver& receiver,
                                               [[maybe_unused]] Row row,
                                               [[maybe_unused]] uint32_t block) const {
  Weights weights;
  if constexpr (kHasSketch<Row>) {
    weights = WeighProduct(nodes_[index], receiver, *row.sketch);
    if (row.steps == nullptr) return weights;
  } else {
    weights = Weigh(nodes_[index], receiver);
  }
  if constexpr (kHasFactors<Row>) {
    if (block < kVisibilityNodesMax) {
      weights.of_child *= VisibilityFactors(row, block * kWidth);
      weights.sum = Sum(weights.of_child);
    }
  }
  return weights;
}

// Walks from the node, whose children have the weights, to a light. Requires: weights.sum > 0.
template <typename Row>
inline ChosenLight LightTree::Descend(const Receiver& receiver, uint32_t index, Weights weights,
                                      double u, Row row, uint32_t block) const {
  NodeProbability probability;
  double rest = u;  // Relative to the beginning of the node's interval.
  for (;;) {
    const Node& node = nodes_[index];
    const NodeProbability::PerChild probabilities = probability.Among(weights);
    // Where rounding leaves the sum below u, the last child of positive probability is chosen.
    size_t chosen = 0;
    double begin = 0, end = 0;
    for (size_t i = 0; i < kWidth; ++i) {
      const NodeProbability of_child = probabilities.Of(i);
      if (!(of_child.Sum() > 0)) continue;
      chosen = i;
      probability = of_child;
      begin = end;
      end += of_child.Sum();
      if (rest < end) break;
    }
    rest -= begin;
    const uint32_t child = node.child[chosen];
    if ((child & kLightBit) != 0) {
      return ChosenLight{child & ~kLightBit, static_cast<float>(probability.Sum())};
    }
    index = child;
    nodes_[index].Prefetch();
    block = row.BlockBelow(block, chosen, index);
    weights = WeighNode(index, receiver, row, block);
  }
}

}  // namespace sheaf::render
