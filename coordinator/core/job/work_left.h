// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WorkLeft: the rest of a job's work. The scheduler computes it, and WorkAhead forecasts wall times
// from it.
#pragma once

#include <cstdint>

namespace sheaf::coordinator {

// The fraction of threads' time that goes into samples, where no measurement exists.
inline constexpr double kUsualThreadUse = 0.95;

// The rest of a job's work. With a stop rule, as far as it is predicted.
struct WorkLeft {
  int32_t priority = 0;
  double sample_count = 0;            // Pixel samples.
  double cpu_seconds_per_sample = 0;  // 0: not known.
  double weight = 1;                  // Its share of samples, relative to others of its priority.
};

}  // namespace sheaf::coordinator
