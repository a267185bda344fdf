// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WorkAhead: the CPU time that a farm spends on other jobs before a given job is done. The
// scheduler serves jobs of higher priority first, and gives jobs of equal priority numbers of pixel
// samples in proportion to their weights (scheduler.h). So jobs of higher priority are completed
// before the job is, and each job of equal priority and weight gets as many samples as the job
// itself, or all that it has left. SharedFarm (shared_farm.h) says when all jobs end, for any
// policy:
//
//     WorkLeft of live jobs > WorkAhead > CpuSeconds / threads that are used = wall time
#pragma once

#include <cstdint>
#include <vector>

#include "coordinator/core/job/work_left.h"
#include "coordinator/forecast/cost_forecast.h"
#include "coordinator/forecast/shared_farm.h"

namespace sheaf::coordinator {

class WorkAhead {
 public:
  WorkAhead() = default;
  // jobs: the live jobs that do not wait for a user, in any order.
  explicit WorkAhead(std::vector<WorkLeft> jobs);

  // Returns the CPU time, in seconds, that the farm spends on `jobs` until `own` is done. `own` may
  // be one of them, or a part of one, and is then included. Samples of unknown cost are assumed to
  // cost as much as those of `own`.
  double CpuSeconds(const WorkLeft& own) const;

 private:
  // Sums over the first jobs of `jobs_`.
  struct Sums {
    double cpu_seconds = 0;             // For all their samples.
    double cpu_seconds_per_sample = 0;  // For one sample of each of weight 1.
    double uncosted_samples = 0;        // Samples of jobs whose cost is not known.
    double uncosted_weight = 0;         // Their weights.
  };

  std::vector<WorkLeft> jobs_;  // By descending priority, then by ascending samples by weight.
  std::vector<Sums> before_;    // Sums over the jobs before each one, and last over all jobs.
};

// The load of a farm, for estimates of when a job would be done.
struct FarmLoad {
  double threads_used = 0;  // Sum over threads of the fraction of time spent on samples.
  WorkAhead ahead;
  SharedFarm shared = {};  // Over the live jobs; empty if only `ahead` is needed.
};

// Returns the wall time of work that has not been submitted to the farm; 0 if there are no threads
// or there is no work.
Estimate WallSeconds(const Estimate& cpu_seconds, double sample_count, int32_t priority,
                     const FarmLoad& load);

}  // namespace sheaf::coordinator
