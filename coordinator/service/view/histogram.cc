// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/view/histogram.h"

#include <algorithm>

#include "common/base/check.h"

namespace sheaf::coordinator {

Histogram::Histogram(std::span<const double> bounds) : bounds_(bounds), counts_(bounds.size() + 1) {
  SHEAF_CHECK(std::is_sorted(bounds.begin(), bounds.end()));
}

void Histogram::Add(absl::Duration duration) {
  const int64_t ns = std::max<int64_t>(0, absl::ToInt64Nanoseconds(duration));
  const double seconds = static_cast<double>(ns) * 1e-9;
  const auto bucket = std::lower_bound(bounds_.begin(), bounds_.end(), seconds) - bounds_.begin();
  counts_[static_cast<size_t>(bucket)].fetch_add(1, std::memory_order_relaxed);
  sum_ns_.fetch_add(static_cast<uint64_t>(ns), std::memory_order_relaxed);
}

Histogram::Counts Histogram::Read() const {
  Counts counts;
  uint64_t sum = 0;
  for (const std::atomic<uint64_t>& count : counts_) {
    sum += count.load(std::memory_order_relaxed);
    counts.up_to.push_back(sum);
  }
  counts.sum_seconds = static_cast<double>(sum_ns_.load(std::memory_order_relaxed)) * 1e-9;
  return counts;
}

}  // namespace sheaf::coordinator
