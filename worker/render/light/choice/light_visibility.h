// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LightVisibility: how much of each light is visible from each region of space, learned from shadow
// rays, so that the choice of a light avoids those that are hidden there. Source of the idea, with
// clusters of lights instead of the nodes of a tree: Vevoda, Kondapaneni and Krivanek 2018,
// "Bayesian online regression for adaptive direct illumination sampling". It decides only how noisy
// an image is, never its mean: no factor is 0, and a part of all choices ignores the factors.
//
// A region has one slot for each light, where a scene weighs each light (kLightsWeighedMax); else
// one for each child of the first nodes of the light tree (LightTree::kVisibilityNodesMax), and one
// for all infinite lights. So a region takes at most kLightVisibilitySlotsMax bytes, and eight
// times that while it learns: 1 MiB and 8 MiB for kLightVisibilityRegionsMax regions. Or each
// region has a cut of the tree: slots for the children of at most kCutBlocks nodes, and one for all
// infinite lights. A cut takes kCutSlots bytes more, for links between its nodes; LearnLightRows
// makes it (worker/render/guiding/light_rows.h).
//
// All sums are integers: the same tries give the same factors, to the bit, in whatever order and on
// however many threads they were counted.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "worker/render/light/choice/light_choice.h"
#include "worker/render/light/choice/light_visibility_row.h"

namespace sheaf::render {

inline constexpr uint32_t kLightVisibilityRegionsMax = 8192;
inline constexpr size_t kLightVisibilitySlotsMax =
    LightTree::kVisibilityNodesMax * LightTree::kWidth + 1;
// A slot's factor is (visible + kVisibilityPrior) / (tries + kVisibilityPrior), so a few hidden
// tries do not decide. In simulated mixes of visible, hidden and partly hidden lights the variance
// is within 3% of the least that any prior from 1 to 8 gives, from 25 tries a light on.
inline constexpr uint64_t kVisibilityPrior = 2;

// Frozen. Thread-safe.
class LightVisibility {
 public:
  // Knows nothing: every row is null.
  LightVisibility() = default;

  // The row of a region; null where the region is not one of region_count().
  LightVisibilityRow RowOf(uint32_t region) const {
    if (region >= region_count_) return {};
    return {steps_.data() + region * slot_count_,
            links_.empty() ? nullptr : links_.data() + region * kCutSlots};
  }
  uint32_t region_count() const { return region_count_; }
  uint64_t memory_bytes() const { return steps_.capacity() + links_.capacity(); }

  // The factors as bytes, the same for equal factors on every machine. At most
  // kLightVisibilityBytesMax.
  std::string Encode() const;
  // Errors: kDataLoss with the reason, for bytes that Encode of a LightVisibility with this
  // choice's slots did not make; never undefined behavior, whatever the bytes.
  static absl::StatusOr<LightVisibility> Decode(std::string_view bytes, const LightChoice& choice);

 private:
  friend class LightRowsLearner;
  friend class LightVisibilityStatistics;
  LightVisibility(uint32_t region_count, size_t slot_count, std::vector<uint8_t> steps)
      : region_count_(region_count), slot_count_(slot_count), steps_(std::move(steps)) {}

  std::string EncodeCuts() const;
  static absl::StatusOr<LightVisibility> DecodeCuts(std::string_view bytes,
                                                    const LightChoice& choice);

  uint32_t region_count_ = 0;
  size_t slot_count_ = 0;
  std::vector<uint8_t> steps_;  // [region][slot].
  std::vector<uint8_t> links_;  // [region][kCutSlots] for cuts; else empty.
};

// The size of the largest encoding.
inline constexpr size_t kLightVisibilityHeaderBytes = 12;
inline constexpr size_t kLightVisibilityBytesMax =
    kLightVisibilityHeaderBytes + kLightVisibilityRegionsMax * kLightVisibilitySlotsMax;
// A cut as bytes: the number of its blocks, the step of all infinite lights, and for each block its
// steps and, but for the first, the slot that it is below.
static_assert(2 + kCutBlocks * (kLaneCount + 1) <= kLightVisibilitySlotsMax);

// Tries by region and slot. Add may be called from many threads; Freeze, when they are done.
class LightVisibilityStatistics {
 public:
  // choice outlives *this. Requires: region_count <= kLightVisibilityRegionsMax.
  LightVisibilityStatistics(const LightChoice& choice, uint32_t region_count);

  // A sample of the light was tried from the region: light that it sends arrived, or was hidden. A
  // node's factor assumes that its lights were chosen without a row; with one it comes out larger,
  // which costs efficiency only. Lights that are never chosen have no slot and do not count.
  // Requires: region < region_count, light < LightTable::light_count(); fewer than 2^32 tries.
  void Add(uint32_t region, uint32_t light, bool visible);
  LightVisibility Freeze() const;
  uint64_t memory_bytes() const { return counts_.capacity() * sizeof(counts_[0]); }

 private:
  const LightChoice& choice_;
  uint32_t region_count_;
  size_t slot_count_;
  // [region][slot]: the tries and, in the upper half, those that were visible.
  std::vector<std::atomic<uint64_t>> counts_;
};

}  // namespace sheaf::render
