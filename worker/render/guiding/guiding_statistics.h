// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GuidingStatistics: what paths found of the light in the regions of a GuidingField, as integer
// sums; Refine: the field that follows from them.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "common/math/vec.h"
#include "worker/render/guiding/guiding_field.h"
#include "worker/render/guiding/guiding_shares.h"
#include "worker/render/guiding/guiding_sink.h"

namespace sheaf::render {

// In units. 2^27 values of this size fit in a sum of 64 bits; more would wrap it around, which
// makes a field bad but not undefined.
inline constexpr double kGuidingValueMax = 0x1p36;
// Units beyond 2^900 or below 2^-900 would leave the range of double.
inline constexpr int kGuidingUnitExponentMax = 900;

// A quad with more than this part of its region's light is quartered. Source: Mueller et al. 2017.
inline constexpr double kGuidingQuadFraction = 0.01;
// A region with more values is halved, in iteration 0; each later iteration has about twice as many
// values and needs the square root of 2 times as many, so that both the number of regions and the
// values of each grow. Source of the rule: Mueller et al. 2017.
inline constexpr double kGuidingSplitValues = 500;
// Where a limit would be exceeded, the thresholds above grow by this factor until it is kept: all
// regions are treated alike.
inline constexpr double kGuidingThresholdGrowth = 1.25;

// The findings of all iterations so far, by the regions and quads of a field. Each has the weight
// of its paths: every one of them estimates the same integrals. Source of the idea, with images
// instead of statistics: Mueller 2019. Empty before the first iteration.
struct GuidingSums {
  std::vector<std::vector<double>> quads;  // [region][4 * node + quad]: in units.
  std::vector<double> numbers;             // [region]: of values.
};

// Sums for the next field, by region and quad of the last one. Add may be called from many threads;
// the other functions after all calls of Add.
class GuidingStatistics {
 public:
  // field outlives *this and stays where it is. unit_exponent: values are counted in units of
  // 2^unit_exponent. Requires: |unit_exponent| <= kGuidingUnitExponentMax.
  GuidingStatistics(const GuidingField& field, int unit_exponent);
  // A path took a direction. Its value is what the vertex scattered of the light that it found
  // (FoundLight::scattered): samples are to follow the product of scattering and light. 0 counts
  // too: the path found nothing.
  // Values above kGuidingValueMax units count as that many; those that are not finite count as 0
  // (and are counted).
  void Add(const FoundLight& found);

  // Numbers of values that were too large, and not finite.
  uint64_t clamped() const { return clamped_; }
  uint64_t non_finite() const { return non_finite_; }
  uint64_t memory_bytes() const;

 private:
  friend class GuidingRefinement;

  // Parts of a region whose values are counted: its halves by the next halvings, the first one in
  // the highest bit.
  static constexpr size_t kParts = size_t{1} << GuidingField::kHalvingsCounted;

  const GuidingField& field_;
  double units_per_value_, value_of_unit_;
  std::vector<size_t> first_quad_;              // [region]: its first index in sums_.
  std::vector<std::atomic<uint64_t>> sums_;     // [region][node][quad]: in units.
  std::vector<std::atomic<uint64_t>> numbers_;  // [region][part]: values there.
  GuidingShares shares_;
  std::atomic<uint64_t> clamped_{0}, non_finite_{0};
};

// The field that the statistics of `field` make: regions with many values are halved, quads with
// more than a small fraction of their region's light are quartered, those with little are joined.
// iteration: from 0; later iterations have more values, and need more of them to halve a region.
//
// A region is halved at most 6 times at once, where its values are: their numbers in the parts are
// known. Its halves have its directions and its light. A region without light forgets what it had
// learned.
//
// *sums: what earlier iterations found, by `field`; becomes what all have found, by the new field.
// A region keeps of it only what this iteration, which has more paths than all before, confirms by
// any light: halves inherit light that is not theirs.
GuidingField Refine(const GuidingField& field, const GuidingStatistics& statistics, int iteration,
                    GuidingSums* sums);
// The same by the statistics alone.
GuidingField Refine(const GuidingField& field, const GuidingStatistics& statistics, int iteration);

}  // namespace sheaf::render
