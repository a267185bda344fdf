// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SharedFarm: forecasts the ends of the jobs that share a farm. It simulates the farm's sharing
// policy over the work that each job has left, as a fluid: at any time each job gets a fraction of
// the threads, and when a job ends the others get more. So a forecast takes the ends of the other
// jobs into account:
//
//     WorkLeft of live jobs + SharePolicy > SharedFarm > time left of each job, with a band
//
// Fluid models of fair sharing: Parekh and Gallager 1993, "A Generalized Processor Sharing Approach
// to Flow Control in Integrated Services Networks", IEEE/ACM Transactions on Networking 1(3).
// WorkAhead has the closed form for one policy, for work that is not yet submitted.
//
// Thread safety: none needed, as a SharedFarm does not change.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "coordinator/core/job/work_left.h"
#include "coordinator/forecast/cost_forecast.h"

namespace sheaf::coordinator {

// A job in the forecast.
struct SharedJob {
  uint64_t job_id = 0;
  WorkLeft left;
  double done_fraction = 0;  // Fraction of its samples; its cost becomes more certain with it.
  // For ShareByTime: its show and user, and their weights.
  std::string show = {}, user = {};
  double show_weight = 1, user_weight = 1;
};

// Returns the fraction of the farm's threads that each of the jobs gets while exactly these have
// work. All costs per sample are positive. The fractions sum to 1.
using SharePolicy = std::function<std::vector<double>(std::span<const SharedJob> jobs)>;

// Jobs of the highest priority share all threads, so that their samples grow in proportion to their
// weights.
std::vector<double> ShareBySamples(std::span<const SharedJob> jobs);
// The same, but they share the time of threads: first the shows, then the users of a show, then the
// jobs of a user, each in proportion to its weight.
std::vector<double> ShareByTime(std::span<const SharedJob> jobs);

// The standard deviation of the logarithm of the actual cost of the rest of a job over its
// forecast.
double CostDeviation(double done_fraction);

class SharedFarm {
 public:
  // Beyond this many jobs the last ones (least priority, most work) are forecast one after the
  // other, without sharing.
  static constexpr size_t kJobsMax = 1000;

  struct End {
    Estimate wall_seconds;     // From now on; the band holds in 8 of 10 cases.
    double alone_seconds = 0;  // The same if the farm had no other job.
  };

  SharedFarm() = default;
  // jobs: the live ones that do not wait for a user. A job of unknown cost is assumed to have the
  // average cost per sample of the others; if no cost is known, nothing is forecast. threads_used:
  // as in FarmLoad. Cost: O(jobs x steps) of at most kJobsMax jobs, with a bounded number of steps.
  SharedFarm(std::vector<SharedJob> jobs, double threads_used,
             const SharePolicy& policy = ShareBySamples);

  // nullptr for a job that is not among them, or if nothing is forecast.
  const End* Find(uint64_t job_id) const;

 private:
  std::map<uint64_t, End> ends_;
};

}  // namespace sheaf::coordinator
