// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The figure of /metrics by which pools of workers may grow and shrink (docs/elastic.md): the CPU
// time that the work which may be leased is expected to take.
#pragma once

#include <string>
#include <vector>

#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// A sample of a scene that nothing is known of, seconds of a thread: examples and public scenes
// cost 1.3 to 185 microseconds (docs/scheduling.md).
inline constexpr double kUnknownSampleSeconds = 20e-6;

// The samples that a job has left.
struct LeasableWork {
  std::string pool;
  double sample_count = 0;
  double cpu_seconds_per_sample = 0;  // 0: not known; the mean of the others is assumed.
};

// Adds a value for each pool of the jobs, and for the default pool.
void AddWorkMetrics(const std::vector<LeasableWork>& jobs, std::vector<MetricView>* metrics);

}  // namespace sheaf::coordinator
