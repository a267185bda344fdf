// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// WorkAhead: what a farm does before a job is done. The scheduler serves jobs of higher priority
// first, and gives those of equal priority equal numbers of pixel samples (scheduler.h). So all of
// the first kind is done before the job is, and of each of the second kind as many samples as the
// job has itself, where it has as many:
//
//     WorkLeft of live jobs > WorkAhead > CpuSeconds / threads that are used = wall time
#pragma once

#include <cstdint>
#include <vector>

#include "coordinator/core/work_left.h"
#include "coordinator/forecast/cost_forecast.h"

namespace sheaf::coordinator {

class WorkAhead {
 public:
  WorkAhead() = default;
  // jobs: live ones that do not wait for a person, in any order.
  explicit WorkAhead(std::vector<WorkLeft> jobs);

  // CPU time, seconds, that goes into the jobs by the time that `own` is done. It may be one of
  // them, or a part of one, and is then counted. Samples of unknown cost are taken to cost what
  // those of `own` do.
  double CpuSeconds(const WorkLeft& own) const;

 private:
  // Sums over the jobs up to one.
  struct Sums {
    double cpu_seconds = 0;             // For all their samples.
    double cpu_seconds_per_sample = 0;  // For one sample of each.
    double uncosted_samples = 0;        // Samples of jobs whose cost is not known.
    double uncosted_jobs = 0;
  };

  std::vector<WorkLeft> jobs_;  // By descending priority, then by ascending sample_count.
  std::vector<Sums> before_;    // Sums over the jobs before each, and over all.
};

// A farm for those who ask when a job would be done on it.
struct FarmLoad {
  double threads_used = 0;  // Sum over threads of the share of their time that samples get.
  WorkAhead ahead;
};

// The wall time of work that is none of the farm's jobs yet; 0 where there are no threads or
// nothing is to be done.
Estimate WallSeconds(const Estimate& cpu_seconds, double sample_count, int32_t priority,
                     const FarmLoad& load);

}  // namespace sheaf::coordinator
