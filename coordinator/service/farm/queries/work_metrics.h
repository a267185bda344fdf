// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The metric by which pools of workers may grow and shrink (docs/elastic.md): the expected CPU time
// of the leasable work.
#pragma once

#include <string>
#include <vector>

#include "coordinator/service/view/farm_view.h"

namespace sheaf::coordinator {

// The assumed thread-seconds of a sample of an unknown scene: examples and public scenes cost 1.3
// to 185 microseconds (docs/scheduling.md).
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
