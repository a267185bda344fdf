// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/frame/sample_ranges.h"

#include <algorithm>
#include <bit>

#include "common/base/check.h"

namespace sheaf::coordinator {

void SampleRanges::Add(Range range) {
  if (range.first >= range.end) return;
  auto begin = std::lower_bound(ranges_.begin(), ranges_.end(), range.first,
                                [](const Range& r, uint64_t first) { return r.end < first; });
  auto end = begin;
  while (end != ranges_.end() && end->first <= range.end) {
    range.first = std::min(range.first, end->first);
    range.end = std::max(range.end, end->end);
    ++end;
  }
  ranges_.insert(ranges_.erase(begin, end), range);
}

void SampleRanges::Remove(Range range) {
  Ranges rest;
  rest.reserve(ranges_.size() + 1);
  for (const Range& r : ranges_) {
    if (r.end <= range.first || range.end <= r.first) {
      rest.push_back(r);
      continue;
    }
    if (r.first < range.first) rest.push_back({r.first, range.first});
    if (range.end < r.end) rest.push_back({range.end, r.end});
  }
  ranges_ = std::move(rest);
}

bool SampleRanges::Contains(Range range) const {
  return std::any_of(ranges_.begin(), ranges_.end(),
                     [&](const Range& r) { return r.first <= range.first && range.end <= r.end; });
}

bool SampleRanges::Overlaps(Range range) const {
  return std::any_of(ranges_.begin(), ranges_.end(),
                     [&](const Range& r) { return r.first < range.end && range.first < r.end; });
}

uint64_t SampleRanges::SampleCount() const {
  uint64_t count = 0;
  for (const Range& r : ranges_) count += r.end - r.first;
  return count;
}

SampleBlock SampleRanges::FirstBlock(uint64_t block_samples_max) const {
  SHEAF_CHECK(!ranges_.empty());
  SHEAF_CHECK(std::has_single_bit(block_samples_max));
  const Range& range = ranges_.front();
  uint64_t count = std::min(block_samples_max, std::bit_floor(range.end - range.first));
  if (range.first != 0) count = std::min(count, range.first & (~range.first + 1));
  return {range.first, count};
}

}  // namespace sheaf::coordinator
