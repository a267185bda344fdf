// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/placement/lease_length.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

namespace sheaf::coordinator {

uint64_t LeaseSamples(const LeaseLength& length, const Limits& limits) {
  if (length.samples_per_second <= 0) return length.pass_samples;
  const auto pixels = static_cast<double>(length.pixel_count);
  const auto pass = static_cast<double>(length.pass_samples);
  // Rounds to the nearest power of two, so that the mean length is the target's.
  double passes =
      std::numbers::sqrt2 * length.samples_per_second * length.target_seconds / (pixels * pass);
  const double slots = std::max(1, length.slots);
  passes = std::min(passes, length.samples_left / (limits.tail_divisor * slots * pixels * pass));
  if (length.samples_max > 0) {
    passes = std::min(passes, static_cast<double>(length.samples_max) / pass);
  }
  passes = std::clamp(passes, 1.0, static_cast<double>(length.passes_max));
  return length.pass_samples * std::bit_floor(static_cast<uint64_t>(passes));
}

}  // namespace sheaf::coordinator
