// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SampleRanges: a set of sample indices as disjoint half-open ranges. A tile has few of them,
// mostly one, so a sorted vector suffices, and one range is stored inline.
#pragma once

#include <cstdint>
#include "absl/container/inlined_vector.h"
#include "common/film/tile_geometry.h"

namespace sheaf::coordinator {

class SampleRanges {
 public:
  struct Range {
    uint64_t first = 0;
    uint64_t end = 0;  // One past the last.
    friend bool operator==(const Range&, const Range&) = default;
  };

  using Ranges = absl::InlinedVector<Range, 1>;

  SampleRanges() = default;
  explicit SampleRanges(Range range) { Add(range); }

  // Adjacent and overlapping ranges become one.
  void Add(Range range);
  void Remove(Range range);
  bool Contains(Range range) const;
  bool Overlaps(Range range) const;
  bool empty() const { return ranges_.empty(); }
  uint64_t SampleCount() const;
  const Ranges& ranges() const { return ranges_; }

  // Returns the largest aligned power-of-two block of at most block_samples_max samples that starts
  // at the lowest index. Requires: not empty; block_samples_max is a power of two.
  SampleBlock FirstBlock(uint64_t block_samples_max) const;

 private:
  Ranges ranges_;  // Ascending, disjoint, not adjacent.
};

constexpr SampleRanges::Range RangeOf(SampleBlock block) { return {block.first, block.End()}; }

}  // namespace sheaf::coordinator
