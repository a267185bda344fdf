// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Histogram: counts of durations between fixed bounds, for percentiles of latencies. Adding a
// duration takes no lock.
#pragma once

#include <atomic>
#include <cstdint>
#include <span>
#include <vector>

#include "absl/time/time.h"

namespace sheaf::coordinator {

// Bounds of the duration of calls, in seconds: from a call answered from memory to one that waits
// for a disk or a user.
inline constexpr double kCallSecondsBounds[] = {0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05,
                                                0.1,    0.25,  0.5,    1,     2.5,  5,     10};

// Thread safety: all members may be called concurrently.
class Histogram {
 public:
  // bounds: seconds, ascending; it must outlive the object.
  explicit Histogram(std::span<const double> bounds);

  // Negative durations count as 0: clocks differ.
  void Add(absl::Duration duration);

  struct Counts {
    // Counts of durations up to each bound, as in Prometheus; the last one counts all.
    std::vector<uint64_t> up_to;
    double sum_seconds = 0;
  };
  // A duration added meanwhile may be in only one of the sums.
  Counts Read() const;
  std::span<const double> bounds() const { return bounds_; }

 private:
  const std::span<const double> bounds_;
  std::vector<std::atomic<uint64_t>> counts_;  // Between two bounds; the last: above all.
  std::atomic<uint64_t> sum_ns_{0};
};

}  // namespace sheaf::coordinator
