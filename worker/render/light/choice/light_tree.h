// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightTree: chooses one of many local lights as seen from a point, in time logarithmic in their
// number. Lights that are close together and face the same way share a node, which stores their
// box, a cone about their normals and the sum of their intensities; a walk from the root descends
// to each child in proportion to an estimate of the light it sends to the point. Source: Conty
// Estevez and Kulla 2018, "Importance Sampling of Many Lights with Adaptive Tree Splitting"; here
// nodes have eight children, which are weighted in SIMD, and boxes and cones are rounded outwards
// to a few bits.
//
// Every light that may illuminate p has a positive probability: bounds err on the side of more
// light, and a fraction of the walks (kIntensityProbability) follows the intensities alone, so no
// light is less likely than kIntensityProbability times its fraction of the total intensity,
// however wrong the estimates are. Results are bit-identical where the unit of length or of light
// changes by a power of two.
//
// Regions of space may have learned which children of some nodes are hidden from them
// (LightVisibility): a walk that follows the estimates multiplies them by the learned factors. And
// the point may have a sketch of how it reflects (LobeSketch): then a child's estimate is of what
// the point reflects of it.
//
// CutAt splits the tree at a point: it divides the lights into several parts, of which each is
// sampled. A part is a run of children of one node. Splitting begins with the whole tree, and
// divides the part whose estimate is the most uncertain, until none is uncertain enough or the
// limit is reached. light_cut.cc has the rule. The parts are a function of the point, so the
// probability of a light within its part is known to whoever finds the light otherwise.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/math/lanes.h"
#include "worker/render/light/choice/light_bounds.h"
#include "worker/render/light/choice/light_visibility_row.h"
#include "worker/render/light/choice/lobe_sketch.h"

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
  static constexpr size_t kVisibilityNodesMax = kFirstNodeBlocks;
  // Most parts of a cut.
  static constexpr size_t kPartsMax = 16;
  class Cut;

  LightTree() = default;
  // Excludes infinite lights, lights of strength 0, and lights with non-finite values or farther
  // than 2^60 from the origin. Requires: at most kLightsMax lights. Cost: O(n log n), about 1 s for
  // a million. splits: whether CutAt may be called, which takes a quarter more memory.
  explicit LightTree(const std::vector<LightBounds>& lights, bool splits = false);

  bool empty() const { return nodes_.empty(); }

  // In all of these, n is a unit normal at p, or zero to accept light from all directions. Lights
  // behind n do not count. row: of the region of p, for this tree's slots, not null. Row:
  // LightVisibilityRow, NoLightVisibilityRow or, for all but parts, ProductRow with a sketch.

  // A rough estimate of the unoccluded irradiance at p; with a sketch, of what is reflected, in
  // units of irradiance by the diffuse part. 0 only where certainly none arrives. Requires:
  // !empty().
  template <typename Row = NoLightVisibilityRow>
  double Irradiance(Vec3f p, Vec3f n, Row row = {}) const;
  // Chooses a light as seen from p; none where Irradiance is 0. Requires: !empty(), u in [0, 1).
  template <typename Row = NoLightVisibilityRow>
  std::optional<ChosenLight> Choose(Vec3f p, Vec3f n, double u, Row row = {}) const;
  // The probability with which Choose returns the light, bit for bit. 0 for excluded lights.
  template <typename Row = NoLightVisibilityRow>
  float Probability(uint32_t light, Vec3f p, Vec3f n, Row row = {}) const;

  // The parts of the lights at p: at most parts_max, none where Irradiance is 0. Lights in no part
  // certainly send nothing. Requires: !empty(), the tree was built for splits, parts_max in
  // [1, kPartsMax].
  template <typename Row = NoLightVisibilityRow>
  Cut CutAt(Vec3f p, Vec3f n, size_t parts_max, Row row = {}) const;
  // Chooses a light of the part. Its probability is that within the part. Requires: cut is CutAt's
  // for the same p, n and row; part < cut.size(); u in [0, 1).
  template <typename Row = NoLightVisibilityRow>
  ChosenLight ChooseFrom(const Cut& cut, size_t part, Vec3f p, Vec3f n, double u,
                         Row row = {}) const;
  // The probability with which ChooseFrom returns the light from the part that holds it, bit for
  // bit. 0 where no part does. Requires: as ChooseFrom.
  template <typename Row = NoLightVisibilityRow>
  float ProbabilityIn(const Cut& cut, uint32_t light, Vec3f p, Vec3f n, Row row = {}) const;

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

  // The place of a child among those of its node.
  struct Place {
    uint32_t node = 0;
    uint32_t child = 0;  // Below kWidth.
  };
  // Calls visit(Place) for the light and each node above it, up to a child of the root, node 0.
  template <typename Visit>
  void VisitPlaces(uint32_t light, const Visit& visit) const {
    for (uint32_t slot = slot_of_light_[light]; slot != kNoSlot;
         slot = nodes_[slot / kWidth].parent) {
      constexpr auto kPlaces = static_cast<uint32_t>(kWidth);
      visit(Place{slot / kPlaces, slot % kPlaces});
    }
  }
  size_t node_count() const { return nodes_.size(); }
  // Whether there are lights at the place.
  bool HasLights(Place at) const { return nodes_[at.node].intensity[at.child] > 0; }
  // The node at the place; none where there is a single light or nothing.
  std::optional<uint32_t> NodeAt(Place at) const {
    const uint32_t child = nodes_[at.node].child[at.child];
    if (!HasLights(at) || (child & kLightBit) != 0) return std::nullopt;
    return child;
  }
  // The estimate of the light's irradiance at p over Irradiance, without the part of the choices
  // that follows intensities; and the probability of Choose. 0 for excluded lights.
  struct Share {
    double estimate = 0, probability = 0;
  };
  Share ShareOf(uint32_t light, Vec3f p, Vec3f n) const;

  size_t size_bytes() const {
    return nodes_.size() * sizeof(Node) + slot_of_light_.size() * sizeof(uint32_t) +
           energies_.size() * sizeof(NodeEnergies);
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

  // How unequal the lights of each child are.
  struct NodeEnergies {
    float count[kWidth] = {};
    float square[kWidth] = {};  // Sum of the squared intensities over the squared sum.
  };

  struct Receiver;
  struct Weights {
    Lanes of_child;
    Lanes intensity;  // 0 for children that certainly send nothing, unless no child sends any.
    float sum;        // 0 where no child sends anything.
    float intensity_sum;
  };
  struct NodeProbability;
  struct SlotPath;
  class Builder;
  class Splitter;
  SlotPath PathTo(uint32_t light) const;
  static Weights Weigh(const Node& node, const Receiver& receiver);
  static Weights WeighProduct(const Node& node, const Receiver& receiver, const LobeSketch& sketch);
  // Inlined into both. sketch: null in Weigh.
  template <bool kIsProduct>
  [[gnu::always_inline]] static inline Weights WeighBy(const Node& node, const Receiver& receiver,
                                                       const LobeSketch* sketch);
  // block: the row's, for the node's children.
  template <typename Row>
  Weights WeighNode(uint32_t index, const Receiver& receiver, Row row, uint32_t block) const;
  template <typename Row>
  ChosenLight Descend(const Receiver& receiver, uint32_t index, Weights weights, double u, Row row,
                      uint32_t block) const;

  // The root first, parents before children; the first kVisibilityNodesMax are those with slots.
  std::vector<Node> nodes_;
  std::vector<uint32_t> slot_of_light_;  // kNoSlot for excluded lights.
  std::vector<NodeEnergies> energies_;   // [nodes_.size()] if built for splits, else empty.
  double irradiance_scale_ = 1;          // Input intensities divided by those in the nodes.
  int depth_ = 0;
};

// The parts of the lights at one point.
class LightTree::Cut {
 public:
  size_t size() const { return size_; }

 private:
  friend class LightTree;
  // The children [first, end) of a node.
  struct Part {
    Weights weights;  // 0 for the node's other children.
    uint32_t node;
    uint32_t first, end;
    uint32_t block;     // The row's, for the node's children.
    float uncertainty;  // Standard deviation of the part's estimate, in its unit.
  };

  size_t size_ = 0;
  std::array<Part, kPartsMax> parts_;
};

}  // namespace sheaf::render
