// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/service/farm/queries/work_metrics.h"

#include <map>

#include "coordinator/core/job/requirements.h"

namespace sheaf::coordinator {

void AddWorkMetrics(const std::vector<LeasableWork>& jobs, std::vector<MetricView>* metrics) {
  double sum = 0;
  int known = 0;
  for (const LeasableWork& job : jobs) {
    sum += job.cpu_seconds_per_sample;
    known += job.cpu_seconds_per_sample > 0 ? 1 : 0;
  }
  const double usual = known > 0 ? sum / known : kUnknownSampleSeconds;
  std::map<std::string, double> seconds = {{kDefaultPool, 0}};
  for (const LeasableWork& job : jobs) {
    const double cost = job.cpu_seconds_per_sample > 0 ? job.cpu_seconds_per_sample : usual;
    seconds[job.pool] += job.sample_count * cost;
  }
  for (const auto& [pool, value] : seconds) {
    metrics->push_back({"sheaf_work_left_cpu_seconds",
                        "Expected CPU time of the leasable work, by pool.",
                        MetricView::Kind::kGauge, "pool", pool, value});
  }
}

}  // namespace sheaf::coordinator
