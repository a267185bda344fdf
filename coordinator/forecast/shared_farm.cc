// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/forecast/shared_farm.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <utility>

namespace sheaf::coordinator {
namespace {

// Steps are at least this fraction of the time of all work, which bounds their number.
constexpr double kStepMin = 1e-3;
// Workers come and go, and the load changes: the log-normal deviation of the farm's speed.
constexpr double kFarmDeviation = 0.1;

// Gives jobs of unknown cost the mean of the others. Returns false if no cost is known.
bool AssumeCosts(std::vector<SharedJob>* jobs) {
  double sum = 0;
  int known = 0;
  for (const SharedJob& job : *jobs) {
    sum += job.left.cpu_seconds_per_sample;
    known += job.left.cpu_seconds_per_sample > 0 ? 1 : 0;
  }
  if (known == 0) return false;
  for (SharedJob& job : *jobs) {
    if (job.left.cpu_seconds_per_sample <= 0) job.left.cpu_seconds_per_sample = sum / known;
  }
  return true;
}

double CpuSecondsOf(const WorkLeft& left) {
  return left.sample_count * left.cpu_seconds_per_sample;
}

int32_t HighestPriority(std::span<const SharedJob> jobs) {
  int32_t highest = std::numeric_limits<int32_t>::min();
  for (const SharedJob& job : jobs) highest = std::max(highest, job.left.priority);
  return highest;
}

// Simulates the jobs that share the farm.
class Fluid {
 public:
  Fluid(std::span<const SharedJob> jobs, double threads) : jobs_(jobs), threads_(threads) {
    for (size_t i = 0; i < jobs.size(); ++i) {
      left_.push_back(jobs[i]);
      active_.push_back(i);
      total_seconds_ += CpuSecondsOf(jobs[i].left) / threads;
    }
  }

  bool Done() const { return active_.empty(); }

  // Advances to the next end of a job, or a little further. Calls ended with each job that ends,
  // the time, and the variance of the CPU time that was spent until then.
  template <typename Ended>
  void Step(const SharePolicy& policy, const Ended& ended) {
    const std::vector<double> shares = policy(left_);
    double next = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < active_.size(); ++i) {
      next = std::min(next, SecondsOf(i, shares));
    }
    if (!std::isfinite(next)) {  // The policy leaves all of them without threads.
      active_.clear();
      return;
    }
    const double step = std::max(next, kStepMin * total_seconds_);
    std::vector<std::pair<size_t, double>> ending;  // Job and time to its end.
    for (size_t i = 0; i < active_.size(); ++i) {
      const double seconds = SecondsOf(i, shares);
      if (seconds <= step) {
        ending.emplace_back(i, seconds);
        left_[i].left.sample_count = 0;
      } else {
        left_[i].left.sample_count *= 1 - step / seconds;
      }
    }
    const double variance = VarianceSpent();
    for (const auto& [i, seconds] : ending) ended(active_[i], now_ + seconds, variance);
    // The rest of the step of ended jobs goes to the others, so the same work takes less time.
    double idle = 0;
    for (const auto& [i, seconds] : ending) idle += shares[i] * (step - seconds);
    now_ += step - idle;
    for (auto at = ending.rbegin(); at != ending.rend(); ++at) {
      const auto i = static_cast<std::ptrdiff_t>(at->first);
      const SharedJob& job = jobs_[active_[at->first]];
      ended_variance_ += Squared(CpuSecondsOf(job.left) * CostDeviation(job.done_fraction));
      active_.erase(active_.begin() + i);
      left_.erase(left_.begin() + i);
    }
  }

 private:
  static double Squared(double x) { return x * x; }

  // The time until the job ends at its present share.
  double SecondsOf(size_t i, std::span<const double> shares) const {
    const double work = CpuSecondsOf(left_[i].left);
    if (work <= 0) return 0;
    return shares[i] > 0 ? work / (threads_ * shares[i]) : std::numeric_limits<double>::infinity();
  }
  double VarianceSpent() const {
    double variance = ended_variance_;
    for (size_t i = 0; i < active_.size(); ++i) {
      const SharedJob& job = jobs_[active_[i]];
      const double spent = CpuSecondsOf(job.left) - CpuSecondsOf(left_[i].left);
      variance += Squared(spent * CostDeviation(job.done_fraction));
    }
    return variance;
  }

  const std::span<const SharedJob> jobs_;
  const double threads_;
  std::vector<size_t> active_;   // Indices of jobs with work.
  std::vector<SharedJob> left_;  // Those jobs, with their work left.
  double now_ = 0, total_seconds_ = 0;
  double ended_variance_ = 0;  // Variance of the CPU time of ended jobs.
};

}  // namespace

std::vector<double> ShareBySamples(std::span<const SharedJob> jobs) {
  const int32_t highest = HighestPriority(jobs);
  std::vector<double> shares(jobs.size(), 0);
  double sum = 0;
  for (size_t i = 0; i < jobs.size(); ++i) {
    if (jobs[i].left.priority != highest) continue;
    shares[i] = jobs[i].left.weight * jobs[i].left.cpu_seconds_per_sample;
    sum += shares[i];
  }
  if (sum > 0) {
    for (double& share : shares) share /= sum;
  }
  return shares;
}

std::vector<double> ShareByTime(std::span<const SharedJob> jobs) {
  const int32_t highest = HighestPriority(jobs);
  struct User {
    double weight = 1, job_weights = 0;
  };
  struct Show {
    double weight = 1, user_weights = 0;
    std::map<std::string, User> users;
  };
  std::map<std::string, Show> shows;
  double show_weights = 0;
  for (const SharedJob& job : jobs) {
    if (job.left.priority != highest) continue;
    const auto [show, is_new_show] = shows.try_emplace(job.show);
    if (is_new_show) show_weights += show->second.weight = job.show_weight;
    const auto [user, is_new_user] = show->second.users.try_emplace(job.user);
    if (is_new_user) show->second.user_weights += user->second.weight = job.user_weight;
    user->second.job_weights += job.left.weight;
  }
  std::vector<double> shares(jobs.size(), 0);
  for (size_t i = 0; i < jobs.size(); ++i) {
    if (jobs[i].left.priority != highest) continue;
    const Show& show = shows.at(jobs[i].show);
    const User& user = show.users.at(jobs[i].user);
    shares[i] = show.weight / show_weights * user.weight / show.user_weights * jobs[i].left.weight /
                user.job_weights;
  }
  return shares;
}

double CostDeviation(double done_fraction) {
  // Judged by jobs of several frames: a frame's cost differs from the others' by about a third, and
  // that of a part of a frame from the rest of it by about a tenth.
  return 0.1 + 0.25 * (1 - std::clamp(done_fraction, 0.0, 1.0));
}

SharedFarm::SharedFarm(std::vector<SharedJob> jobs, double threads_used,
                       const SharePolicy& policy) {
  std::erase_if(jobs, [](const SharedJob& job) { return job.left.sample_count <= 0; });
  if (threads_used <= 0 || !AssumeCosts(&jobs)) return;
  std::stable_sort(jobs.begin(), jobs.end(), [](const SharedJob& a, const SharedJob& b) {
    const int32_t priorities[] = {a.left.priority, b.left.priority};
    if (priorities[0] != priorities[1]) return priorities[0] > priorities[1];
    return CpuSecondsOf(a.left) < CpuSecondsOf(b.left);
  });
  const auto note = [&](const SharedJob& job, double seconds, double variance) {
    const double cpu_seconds = std::max(seconds * threads_used, 1e-9);
    const double deviation = std::hypot(std::sqrt(variance) / cpu_seconds, kFarmDeviation);
    ends_[job.job_id] = {WithBand(seconds, seconds, seconds, deviation),
                         CpuSecondsOf(job.left) / threads_used};
  };
  const std::span<const SharedJob> shared =
      std::span<const SharedJob>(jobs).first(std::min(jobs.size(), kJobsMax));
  double last_seconds = 0, last_variance = 0;
  Fluid fluid(shared, threads_used);
  while (!fluid.Done()) {
    fluid.Step(policy, [&](size_t index, double seconds, double variance) {
      note(shared[index], seconds, variance);
      last_seconds = std::max(last_seconds, seconds);
      last_variance = variance;
    });
  }
  for (size_t i = shared.size(); i < jobs.size(); ++i) {
    const double cpu_seconds = CpuSecondsOf(jobs[i].left);
    last_seconds += cpu_seconds / threads_used;
    last_variance += cpu_seconds * cpu_seconds * CostDeviation(jobs[i].done_fraction) *
                     CostDeviation(jobs[i].done_fraction);
    note(jobs[i], last_seconds, last_variance);
  }
}

const SharedFarm::End* SharedFarm::Find(uint64_t job_id) const {
  const auto found = ends_.find(job_id);
  return found == ends_.end() ? nullptr : &found->second;
}

}  // namespace sheaf::coordinator
