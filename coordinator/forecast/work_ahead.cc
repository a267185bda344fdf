// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/work_ahead.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace sheaf::coordinator {
namespace {

std::pair<int32_t, double> OrderOf(const WorkLeft& job) {
  return {-job.priority, job.sample_count / job.weight};
}

bool Before(const WorkLeft& a, const WorkLeft& b) { return OrderOf(a) < OrderOf(b); }

}  // namespace

WorkAhead::WorkAhead(std::vector<WorkLeft> jobs) : jobs_(std::move(jobs)) {
  std::sort(jobs_.begin(), jobs_.end(), Before);
  Sums sums;
  before_.push_back(sums);
  for (const WorkLeft& job : jobs_) {
    const bool costed = job.cpu_seconds_per_sample > 0;
    sums.cpu_seconds += job.sample_count * job.cpu_seconds_per_sample;
    sums.cpu_seconds_per_sample += job.weight * job.cpu_seconds_per_sample;
    sums.uncosted_samples += costed ? 0 : job.sample_count;
    sums.uncosted_weight += costed ? 0 : job.weight;
    before_.push_back(sums);
  }
}

double WorkAhead::CpuSeconds(const WorkLeft& own) const {
  if (jobs_.empty()) return 0;
  const auto index_of = [&](const WorkLeft& job) {
    return std::upper_bound(jobs_.begin(), jobs_.end(), job, Before) - jobs_.begin();
  };
  // Jobs before `done` are completed first; those from there to `end` get as many samples as `own`,
  // in proportion to their weights.
  const Sums& done = before_[index_of(own)];
  WorkLeft last_equal = own;
  last_equal.sample_count = std::numeric_limits<double>::infinity();
  const Sums& end = before_[index_of(last_equal)];
  const double samples = own.sample_count / own.weight;  // For a job of weight 1.
  const double uncosted =
      done.uncosted_samples + samples * (end.uncosted_weight - done.uncosted_weight);
  return done.cpu_seconds + samples * (end.cpu_seconds_per_sample - done.cpu_seconds_per_sample) +
         own.cpu_seconds_per_sample * uncosted;
}

Estimate WallSeconds(const Estimate& cpu_seconds, double sample_count, int32_t priority,
                     const FarmLoad& load) {
  if (load.threads_used <= 0 || sample_count <= 0) return {};
  const auto wall = [&](double own_seconds) {
    const WorkLeft own{priority, sample_count, own_seconds / sample_count};
    return (own_seconds + load.ahead.CpuSeconds(own)) / load.threads_used;
  };
  return {wall(cpu_seconds.value), wall(cpu_seconds.low), wall(cpu_seconds.high)};
}

}  // namespace sheaf::coordinator
