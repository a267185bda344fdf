// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/guiding/light_rows.h"

#include <algorithm>
#include <array>
#include <optional>
#include <span>
#include <utility>

#include "common/base/check.h"

namespace sheaf::render {
namespace {

// Tries of a light, or of those below a place of the tree.
struct Sums {
  uint64_t tries = 0, visible = 0;
  uint64_t seen_estimate = 0, contribution = 0;  // Sums over the visible ones.

  void Add(const LightTry& tried) {
    ++tries;
    if (!tried.is_visible) return;
    ++visible;
    seen_estimate += tried.estimate;
    contribution += tried.contribution;
  }
  void Add(const Sums& other) {
    tries += other.tries;
    visible += other.visible;
    seen_estimate += other.seen_estimate;
    contribution += other.contribution;
  }
};

// A factor before the largest one becomes 1. of_all: the sums of all that it is compared with.
double FactorOf(const Sums& sums, const Sums& of_all) {
  const double mean_seen =
      (static_cast<double>(of_all.visible) + 1) / (static_cast<double>(of_all.tries) + 1);
  const double seen = (static_cast<double>(sums.visible) + kVisiblePrior * mean_seen) /
                      (static_cast<double>(sums.tries) + kVisiblePrior);
  if (of_all.seen_estimate == 0 || of_all.contribution == 0) return seen;
  const double mean =
      static_cast<double>(of_all.contribution) / static_cast<double>(of_all.seen_estimate);
  constexpr double kPriorUnits = kContributionPrior * kLightTryUnit;
  const double brought = (static_cast<double>(sums.contribution) + kPriorUnits * mean) /
                         ((static_cast<double>(sums.seen_estimate) + kPriorUnits) * mean);
  return seen * std::clamp(brought, 1 / kContributionFactorMax, kContributionFactorMax);
}

// Writes the steps of the factors that are compared with each other.
class StepWriter {
 public:
  void Add(const Sums& sums, uint8_t* step) {
    all_.Add(sums);
    slots_[count_++] = {sums, step};
  }
  void Write() const {
    double most = 0;
    std::array<double, kSlotsMax> factors{};
    for (size_t i = 0; i < count_; ++i) {
      factors[i] = FactorOf(slots_[i].sums, all_);
      most = std::max(most, factors[i]);
    }
    for (size_t i = 0; i < count_; ++i) {
      const auto steps = static_cast<int>(kVisibilitySteps * (factors[i] / most) + 0.5);
      *slots_[i].step = static_cast<uint8_t>(std::max(steps - 1, int{kVisibilityStepMin}));
    }
  }

 private:
  // The children of the root and the infinite lights, or all lights that are weighed.
  static constexpr size_t kSlotsMax = kLightsWeighedMax + 1;
  struct Slot {
    Sums sums;
    uint8_t* step = nullptr;
  };
  std::array<Slot, kSlotsMax> slots_;
  size_t count_ = 0;
  Sums all_;
};

// The cut of one region.
class CutMaker {
 public:
  explicit CutMaker(const LightTree& tree) : tree_(tree) {}

  // steps: kCutSlots + 1, of one; links: kCutSlots, to no block.
  void Make(std::span<const LightTry* const> tries, const LightChoice& choice, uint8_t* steps,
            uint8_t* links) {
    candidates_.clear();
    block_count_ = 0;
    Sums infinite;
    std::vector<const LightTry*> local;
    for (const LightTry* const tried : tries) {
      if (choice.IsAmongInfinite(tried->light)) {
        infinite.Add(*tried);
      } else {
        local.push_back(tried);
      }
    }
    Candidate root = CandidateAt(0, 0, std::move(local));
    const bool has_infinite = choice.HasVisibilitySlot(tree_.visibility_slot_count());
    AddBlock(root, has_infinite ? &infinite : nullptr, steps);
    while (block_count_ < kCutBlocks && !candidates_.empty()) {
      // Among equals, the first.
      const auto best =
          std::max_element(candidates_.begin(), candidates_.end(),
                           [](const Candidate& a, const Candidate& b) { return a.gain < b.gain; });
      const Candidate chosen = std::move(*best);
      candidates_.erase(best);
      links[chosen.slot] = static_cast<uint8_t>(block_count_);
      AddBlock(chosen, nullptr, steps);
    }
  }

 private:
  // A node that may join the cut.
  struct Candidate {
    uint32_t node = 0;
    uint32_t slot = 0;  // The cut's, that it is below.
    std::vector<const LightTry*> tries;
    std::array<Sums, kLaneCount> of_child;
    uint64_t gain = 0;  // Tries that were seen or hidden otherwise than the mean tells.
  };

  uint32_t ChildOf(uint32_t light, uint32_t node) const {
    uint32_t child = 0;
    tree_.VisitPlaces(light, [&](LightTree::Place place) {
      if (place.node == node) child = place.child;
    });
    return child;
  }

  Candidate CandidateAt(uint32_t node, uint32_t slot, std::vector<const LightTry*> tries) const {
    Candidate candidate{node, slot, std::move(tries), {}, 0};
    for (const LightTry* const tried : candidate.tries) {
      candidate.of_child[ChildOf(tried->light, node)].Add(*tried);
    }
    Sums all;
    for (const Sums& sums : candidate.of_child) all.Add(sums);
    if (all.tries == 0) return candidate;
    uint64_t difference = 0;
    for (const Sums& sums : candidate.of_child) {
      const uint64_t here = sums.visible * all.tries, mean = all.visible * sums.tries;
      difference += here > mean ? here - mean : mean - here;
    }
    candidate.gain = difference / all.tries;
    // The square of what chance makes of it: children of which equal parts are seen differ by a
    // standard deviation.
    const auto gain = static_cast<double>(candidate.gain), number = static_cast<double>(all.tries),
               seen = static_cast<double>(all.visible);
    const double chance = 0.5 * kLaneCount * seen * (number - seen) / number;
    if (candidate.gain < kCutGainMin || gain * gain <= chance) candidate.gain = 0;
    return candidate;
  }

  // infinite: compared with the root's children; may be null.
  void AddBlock(const Candidate& block, const Sums* infinite, uint8_t* steps) {
    const auto first_slot = static_cast<uint32_t>(block_count_++ * kLaneCount);
    StepWriter writer;
    if (infinite != nullptr) writer.Add(*infinite, steps + kCutSlots);
    for (uint32_t i = 0; i < kLaneCount; ++i) {
      if (!tree_.HasLights({block.node, i})) continue;
      writer.Add(block.of_child[i], steps + first_slot + i);
      const std::optional<uint32_t> node = tree_.NodeAt({block.node, i});
      if (!node || block.of_child[i].tries < kCutTriesMin) continue;
      std::vector<const LightTry*> below;
      for (const LightTry* const tried : block.tries) {
        if (ChildOf(tried->light, block.node) == i) below.push_back(tried);
      }
      Candidate candidate = CandidateAt(*node, first_slot + i, std::move(below));
      if (candidate.gain > 0) candidates_.push_back(std::move(candidate));
    }
    writer.Write();
  }

  const LightTree& tree_;
  std::vector<Candidate> candidates_;
  size_t block_count_ = 0;
};

}  // namespace

class LightRowsLearner {
 public:
  static LightVisibility Learn(const LightChoice& choice, uint32_t region_count,
                               std::vector<LightTry> tries) {
    SHEAF_CHECK(region_count <= kLightVisibilityRegionsMax);
    const size_t slots = choice.visibility_slot_count();
    if (slots == 0 || region_count == 0) return {};
    // Equal regions come together; within one, the order does not matter.
    std::sort(tries.begin(), tries.end(),
              [](const LightTry& a, const LightTry& b) { return a.region < b.region; });
    const bool has_cuts = choice.tree() != nullptr;
    const size_t row_slots = has_cuts ? kCutSlots + 1 : slots;
    LightVisibility rows(region_count, row_slots,
                         std::vector<uint8_t>(region_count * row_slots, kVisibilityStepOfOne));
    if (has_cuts) rows.links_.assign(region_count * kCutSlots, kNoBlock);
    std::optional<CutMaker> maker;
    if (has_cuts) maker.emplace(*choice.tree());
    for (size_t begin = 0; begin < tries.size();) {
      const uint32_t region = tries[begin].region;
      size_t end = begin;
      while (end < tries.size() && tries[end].region == region) ++end;
      std::vector<const LightTry*> here;
      for (size_t i = begin; i < end; ++i) here.push_back(&tries[i]);
      uint8_t* const steps = rows.steps_.data() + region * row_slots;
      if (maker) {
        maker->Make(here, choice, steps, rows.links_.data() + region * kCutSlots);
      } else {
        WriteList(here, choice, steps);
      }
      begin = end;
    }
    return rows;
  }

 private:
  static void WriteList(std::span<const LightTry* const> tries, const LightChoice& choice,
                        uint8_t* steps) {
    std::array<Sums, kLightsWeighedMax> of_light;
    if (choice.tree() != nullptr || choice.visibility_slot_count() > of_light.size()) return;
    for (const LightTry* const tried : tries) {
      choice.VisitVisibilitySlots(tried->light, [&](size_t slot) { of_light[slot].Add(*tried); });
    }
    StepWriter writer;
    for (size_t slot = 0; slot < choice.visibility_slot_count(); ++slot) {
      if (choice.HasVisibilitySlot(slot)) writer.Add(of_light[slot], steps + slot);
    }
    writer.Write();
  }
};

LightVisibility LearnLightRows(const LightChoice& choice, uint32_t region_count,
                               std::vector<LightTry> tries) {
  return LightRowsLearner::Learn(choice, region_count, std::move(tries));
}

}  // namespace sheaf::render
