// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/render/light/choice/light_visibility.h"

#include <algorithm>
#include <array>
#include <iterator>
#include <optional>

#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "common/base/check.h"

namespace sheaf::render {
namespace {

// Begins every encoding; the digit is the version of the form. The counts of regions and of slots
// follow, as four bytes each, the lowest first; then the steps.
constexpr std::string_view kMagic = "SLV1";
// The same for cuts: the count of regions follows, then the regions (light_visibility.h).
constexpr std::string_view kMagicOfCuts = "SLC1";
constexpr size_t kCountBytes = 4;
static_assert(kMagic.size() + 2 * kCountBytes == kLightVisibilityHeaderBytes);
// Where the tries and the visible ones of a slot are in its count.
constexpr int kVisibleShift = 32;
constexpr uint64_t kTriesMask = (uint64_t{1} << kVisibleShift) - 1;

static_assert(kLightsWeighedMax <= kLightVisibilitySlotsMax);

// The step of (visible + prior) / (tries + prior), rounded to nearest. Requires: visible <= tries.
uint8_t StepOf(uint64_t tries, uint64_t visible) {
  const uint64_t whole = tries + kVisibilityPrior;
  const uint64_t steps = (kVisibilitySteps * (visible + kVisibilityPrior) + whole / 2) / whole;
  return static_cast<uint8_t>(std::max<uint64_t>(steps, kVisibilityStepMin + 1) - 1);
}

void AppendCount(size_t count, std::string* bytes) {
  for (size_t i = 0; i < kCountBytes; ++i) bytes->push_back(static_cast<char>(count >> (8 * i)));
}
size_t CountAt(std::string_view bytes, size_t at) {
  size_t count = 0;
  for (size_t i = 0; i < kCountBytes; ++i) {
    count |= static_cast<size_t>(static_cast<uint8_t>(bytes[at + i])) << (8 * i);
  }
  return count;
}

absl::Status Unusable(const std::string& why) {
  return absl::DataLossError(
      absl::StrCat("the learned visibility of lights ", why, "; learn it again for this scene"));
}

}  // namespace

std::string LightVisibility::EncodeCuts() const {
  std::string bytes(kMagicOfCuts);
  AppendCount(region_count_, &bytes);
  for (size_t region = 0; region < region_count_; ++region) {
    const uint8_t* const steps = steps_.data() + region * slot_count_;
    const uint8_t* const links = links_.data() + region * kCutSlots;
    std::array<uint8_t, kCutBlocks> above{};
    size_t blocks = 1;
    for (size_t slot = 0; slot < kCutSlots; ++slot) {
      if (links[slot] == kNoBlock) continue;
      above[links[slot]] = static_cast<uint8_t>(slot);
      ++blocks;
    }
    bytes.push_back(static_cast<char>(blocks));
    bytes.push_back(static_cast<char>(steps[kCutSlots]));
    for (size_t block = 0; block < blocks; ++block) {
      if (block > 0) bytes.push_back(static_cast<char>(above[block]));
      bytes.append(steps + block * kLaneCount, steps + (block + 1) * kLaneCount);
    }
  }
  return bytes;
}

absl::StatusOr<LightVisibility> LightVisibility::DecodeCuts(std::string_view bytes,
                                                            const LightChoice& choice) {
  const LightTree* const tree = choice.tree();
  if (tree == nullptr) return Unusable("has cuts of a tree that the scene lacks");
  bytes.remove_prefix(kMagicOfCuts.size());
  if (bytes.size() < kCountBytes) return Unusable("ends too early");
  const size_t region_count = CountAt(bytes, 0);
  bytes.remove_prefix(kCountBytes);
  if (region_count == 0 || region_count > kLightVisibilityRegionsMax) {
    return Unusable(
        absl::StrCat("has ", region_count, " regions, not 1 to ", kLightVisibilityRegionsMax));
  }
  const bool has_infinite = choice.HasVisibilitySlot(tree->visibility_slot_count());
  LightVisibility cuts(static_cast<uint32_t>(region_count), kCutSlots + 1,
                       std::vector<uint8_t>(region_count * (kCutSlots + 1), kVisibilityStepOfOne));
  cuts.links_.assign(region_count * kCutSlots, kNoBlock);
  for (size_t region = 0; region < region_count; ++region) {
    uint8_t* const steps = cuts.steps_.data() + region * (kCutSlots + 1);
    uint8_t* const links = cuts.links_.data() + region * kCutSlots;
    if (bytes.size() < 2) return Unusable("ends too early");
    const auto blocks = static_cast<uint8_t>(bytes[0]);
    steps[kCutSlots] = static_cast<uint8_t>(bytes[1]);
    bytes.remove_prefix(2);
    if (blocks == 0 || blocks > kCutBlocks) return Unusable("has a cut of impossible size");
    if (steps[kCutSlots] < (has_infinite ? kVisibilityStepMin : kVisibilityStepOfOne)) {
      return Unusable("has an impossible factor of infinite lights");
    }
    if (bytes.size() < blocks * kLaneCount + blocks - 1) return Unusable("ends too early");
    std::array<uint32_t, kCutBlocks> nodes{};
    for (uint8_t block = 0; block < blocks; ++block) {
      if (block > 0) {
        const auto above = static_cast<uint8_t>(bytes[0]);
        bytes.remove_prefix(1);
        if (above >= block * kLaneCount || links[above] != kNoBlock) {
          return Unusable("has a cut with an impossible link");
        }
        const std::optional<uint32_t> node =
            tree->NodeAt({nodes[above / kLaneCount], above % static_cast<uint32_t>(kLaneCount)});
        if (!node) return Unusable("has a cut below a single light");
        nodes[block] = *node;
        links[above] = block;
      }
      for (uint32_t i = 0; i < kLaneCount; ++i) {
        const auto step = static_cast<uint8_t>(bytes[i]);
        const bool is_used = tree->HasLights({nodes[block], i});
        if (step < (is_used ? kVisibilityStepMin : kVisibilityStepOfOne)) {
          return Unusable("has an impossible factor in a cut");
        }
        steps[block * kLaneCount + i] = step;
      }
      bytes.remove_prefix(kLaneCount);
    }
  }
  if (!bytes.empty()) return Unusable("has bytes after its end");
  return cuts;
}

std::string LightVisibility::Encode() const {
  if (!links_.empty()) return EncodeCuts();
  std::string bytes(kMagic);
  bytes.reserve(kLightVisibilityHeaderBytes + steps_.size());
  AppendCount(region_count_, &bytes);
  AppendCount(slot_count_, &bytes);
  bytes.append(steps_.begin(), steps_.end());
  return bytes;
}

absl::StatusOr<LightVisibility> LightVisibility::Decode(std::string_view bytes,
                                                        const LightChoice& choice) {
  if (bytes.starts_with(kMagicOfCuts)) return DecodeCuts(bytes, choice);
  if (bytes.size() < kLightVisibilityHeaderBytes || !bytes.starts_with(kMagic)) {
    return Unusable("does not begin as one");
  }
  const size_t region_count = CountAt(bytes, kMagic.size());
  const size_t slot_count = CountAt(bytes, kMagic.size() + kCountBytes);
  if (region_count == 0 && slot_count == 0 && bytes.size() == kLightVisibilityHeaderBytes) {
    return LightVisibility();
  }
  if (region_count == 0 || region_count > kLightVisibilityRegionsMax) {
    return Unusable(
        absl::StrCat("has ", region_count, " regions, not 1 to ", kLightVisibilityRegionsMax));
  }
  if (slot_count == 0 || slot_count != choice.visibility_slot_count()) {
    return Unusable(absl::StrCat("is for ", slot_count,
                                 " lights and groups of lights, the scene has ",
                                 choice.visibility_slot_count()));
  }
  bytes.remove_prefix(kLightVisibilityHeaderBytes);
  if (bytes.size() != region_count * slot_count) {
    return Unusable(
        absl::StrCat("has ", bytes.size(), " factors, not ", region_count, " times ", slot_count));
  }
  std::vector<uint8_t> steps(bytes.begin(), bytes.end());
  for (size_t i = 0; i < steps.size(); ++i) {
    const uint8_t least =
        choice.HasVisibilitySlot(i % slot_count) ? kVisibilityStepMin : kVisibilityStepOfOne;
    if (steps[i] < least) {
      return Unusable(absl::StrCat("has the factor ", steps[i] + 1, " / ", kVisibilitySteps,
                                   " where at least ", least + 1, " / ", kVisibilitySteps,
                                   " is possible"));
    }
  }
  return LightVisibility(static_cast<uint32_t>(region_count), slot_count, std::move(steps));
}

LightVisibilityStatistics::LightVisibilityStatistics(const LightChoice& choice,
                                                     uint32_t region_count)
    : choice_(choice),
      region_count_(region_count),
      slot_count_(choice.visibility_slot_count()),
      counts_(region_count * slot_count_) {
  SHEAF_CHECK(region_count <= kLightVisibilityRegionsMax);
  SHEAF_CHECK(slot_count_ <= kLightVisibilitySlotsMax);
}

void LightVisibilityStatistics::Add(uint32_t region, uint32_t light, bool visible) {
  SHEAF_DCHECK(region < region_count_);
  const uint64_t one = 1 + (static_cast<uint64_t>(visible) << kVisibleShift);
  choice_.VisitVisibilitySlots(light, [&](size_t slot) {
    counts_[region * slot_count_ + slot].fetch_add(one, std::memory_order_relaxed);
  });
}

LightVisibility LightVisibilityStatistics::Freeze() const {
  if (counts_.empty()) return {};
  std::vector<uint8_t> steps;
  steps.reserve(counts_.size());
  for (const std::atomic<uint64_t>& count : counts_) {
    const uint64_t both = count.load(std::memory_order_relaxed);
    steps.push_back(StepOf(both & kTriesMask, both >> kVisibleShift));
  }
  return {region_count_, slot_count_, std::move(steps)};
}

}  // namespace sheaf::render
