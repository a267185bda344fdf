// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightChoice: selects the light to sample at a point, and gives the probability of that choice. A
// scene of few lights weights each light at every point by an estimate of its unoccluded
// irradiance; a scene of many lights uses a hierarchy (LightTree) for the local lights, and a
// distribution for the infinite ones. In both cases a fraction of the probability is independent of
// the estimates, so a wrong estimate (a shadow, a narrow lobe) costs efficiency but adds no bias. A
// light has probability 0 only where it certainly sends nothing; a single light has probability 1
// exactly. Every estimate is a ratio of like quantities, so the scene's unit of length does not
// matter.
//
// Where a region of space has learned which lights are hidden from it (LightVisibility), estimates
// are multiplied by the learned factors; the fraction that is independent of them stays.
//
// A choice that is built for splits uses the hierarchy for any number of lights but one. CutAt then
// gives the parts of the lights at a point: all infinite lights are one, the others are those of
// LightTree::CutAt.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/light/choice/light_bounds.h"
#include "worker/render/light/choice/light_query.h"
#include "worker/render/light/choice/light_tree.h"
#include "worker/render/light/choice/light_visibility_row.h"
#include "worker/render/sampling/discrete_distribution.h"

namespace sheaf::render {

// Scenes of at most this many lights weight every light at every point.
inline constexpr size_t kLightsWeighedMax = 16;

// The parts of all lights at a point. The infinite lights, if they are a part, are the first.
struct LightCut {
  size_t size() const { return (has_infinite ? 1 : 0) + local.size(); }

  bool has_infinite = false;
  LightTree::Cut local;
};

class LightChoice {
 public:
  static constexpr size_t kPartsMax = LightTree::kPartsMax;

  LightChoice();
  ~LightChoice();
  LightChoice(LightChoice&&) noexcept;
  LightChoice& operator=(LightChoice&&) noexcept;
  // splits: whether CutAt may be called.
  explicit LightChoice(std::vector<LightBounds> lights, bool splits = false);

  // Chooses a light as seen from p; none where no light reaches p. n: unit normal at p, zero to
  // accept light from all directions; lights behind n do not count. salt: bits independent of u
  // (SaltOf). row: of the region of p, for this choice's slots, and the sketch of the point there.
  // Row: LightVisibilityRow, NoLightVisibilityRow or ProductRow.
  template <typename Row = NoLightVisibilityRow>
  std::optional<ChosenLight> Choose(Vec3f p, Vec3f n, float u, uint64_t salt, Row row = {}) const;
  // The probability with which Choose returns the light at p, bit for bit.
  template <typename Row = NoLightVisibilityRow>
  float Probability(uint32_t light, Vec3f p, Vec3f n, Row row = {}) const;

  // Whether there are lights to split. False for a single light.
  bool splits() const { return splits_; }
  // The parts of the lights at p: at most samples_max, none where no light reaches p. Lights in no
  // part certainly send nothing. Requires: splits(), samples_max in [2, kPartsMax].
  template <typename Row = NoLightVisibilityRow>
  LightCut CutAt(Vec3f p, Vec3f n, uint32_t samples_max, Row row = {}) const;
  // Chooses a light of the part. Its probability is that within the part. Requires: cut is CutAt's
  // for the same p, n and row; part < cut.size(); u and salt as for Choose.
  template <typename Row = NoLightVisibilityRow>
  ChosenLight ChooseFrom(const LightCut& cut, size_t part, Vec3f p, Vec3f n, float u, uint64_t salt,
                         Row row = {}) const;
  // The probability of the light within its part, as of ChooseFrom, bit for bit; where the query is
  // for a single sample, or there are no parts, as of Choose. Parts do not depend on sketches.
  template <typename Row>
  float Probability(uint32_t light, Vec3f p, Vec3f n, SplitLightQuery<Row> query) const;

  // The estimates of the choice, without what ignores them: of the irradiance at p by all lights,
  // and the light's part of it, in 0 to 1. The probability is that of the light.
  struct Estimate {
    double all = 0, share = 0, probability = 0;
  };
  Estimate EstimateOf(uint32_t light, Vec3f p, Vec3f n) const;
  // The tree that local lights are chosen by; null where there is none.
  const LightTree* tree() const { return uses_tree_ && !tree_.empty() ? &tree_ : nullptr; }
  // Whether the light is one of the infinite ones that are chosen together.
  bool IsAmongInfinite(uint32_t light) const { return InfiniteRank(light).has_value(); }

  uint64_t memory_bytes() const;

  // The slots of a row: one for each light, in whole lanes; or those of the tree, then one for all
  // infinite lights. None where there is no choice.
  size_t visibility_slot_count() const;
  // Whether the slot stands for a light. Requires: slot < visibility_slot_count().
  bool HasVisibilitySlot(size_t slot) const;
  // Calls visit(slot) for the slots that the light is in. Requires: light is an index of `lights`.
  template <typename Visit>
  void VisitVisibilitySlots(uint32_t light, const Visit& visit) const {
    if (count_ <= 1) return;
    if (!uses_tree_) {
      visit(light);
    } else if (std::binary_search(infinite_lights_.begin(), infinite_lights_.end(), light)) {
      visit(tree_.visibility_slot_count());
    } else {
      tree_.VisitVisibilitySlots(light, visit);
    }
  }

 private:
  struct Weights;
  struct Block;
  template <typename Row>
  Weights Weigh(Vec3f p, Vec3f n, Row row) const;
  template <typename Row>
  double InfiniteProbability(Vec3f p, Vec3f n, Row row) const;
  float ProbabilityInfinite(size_t rank, double infinite_probability) const;
  template <typename Row>
  float ProbabilityInPart(uint32_t light, Vec3f p, Vec3f n, SplitLightQuery<Row> query) const;
  // The light's rank among infinite_lights_; none if it is not one of them.
  std::optional<size_t> InfiniteRank(uint32_t light) const;

  size_t count_ = 0;
  bool splits_ = false;
  bool uses_tree_ = false;  // For more than kLightsWeighedMax lights, and for splits.
  // Used without the tree.
  std::vector<Block> blocks_;
  // Used with it.
  LightTree tree_;
  std::vector<uint32_t> infinite_lights_;  // Ascending, not black.
  DiscreteDistribution infinite_;          // Over infinite_lights_.
  double infinite_irradiance_ = 0;
};

}  // namespace sheaf::render
