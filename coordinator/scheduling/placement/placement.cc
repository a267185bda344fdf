// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/placement/placement.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"

namespace sheaf::coordinator {
namespace {

std::string WarmKey(const std::string& numeric_profile, const std::string& scene) {
  return absl::StrCat(scene, " ", numeric_profile);
}

}  // namespace

void WarmWorkers::Set(const std::string& worker_id, const std::string& numeric_profile,
                      const std::set<std::string>& scenes) {
  Keys keys;
  for (const std::string& scene : scenes) keys.insert(WarmKey(numeric_profile, scene));
  const auto known = keys_of_.find(worker_id);
  if (known == keys_of_.end() ? keys.empty() : known->second == keys) return;
  for (const std::string& key : keys) ++counts_[key];
  if (known != keys_of_.end()) {
    for (const std::string& key : known->second) {
      const auto count = counts_.find(key);
      if (--count->second == 0) counts_.erase(count);
    }
  }
  if (keys.empty()) {
    keys_of_.erase(known);
  } else {
    keys_of_[worker_id] = std::move(keys);
  }
}

int WarmWorkers::CountOf(const std::string& numeric_profile, const std::string& scene) const {
  const auto found = counts_.find(WarmKey(numeric_profile, scene));
  return found == counts_.end() ? 0 : found->second;
}

void SceneJobs::Set(const std::string& scene, uint64_t job_id, bool has_work) {
  if (has_work) {
    jobs_[scene].insert(job_id);
    return;
  }
  const auto found = jobs_.find(scene);
  if (found == jobs_.end()) return;
  found->second.erase(job_id);
  if (found->second.empty()) jobs_.erase(found);
}

const absl::btree_set<uint64_t>& SceneJobs::Of(const std::string& scene) const {
  static const absl::btree_set<uint64_t> kNone;
  const auto found = jobs_.find(scene);
  return found == jobs_.end() ? kNone : found->second;
}

bool MayPassOver(const PassingOver& state, SteadyTime now, const Limits& limits) {
  const SteadyTime since = std::min(state.job_passed_time, now);
  return now < state.worker_cold_time + limits.warm_stay_min && now < since + limits.warm_wait_max;
}

std::vector<size_t> ColdOrder(std::span<const ColdWork> choices,
                              const std::function<int(const std::string& scene)>& warm_count) {
  std::map<std::string, double> left;
  for (const ColdWork& choice : choices) left[choice.scene] += choice.samples_left;
  for (auto& [scene, value] : left) {
    const int count = warm_count(scene);
    value = count == 0 ? std::numeric_limits<double>::infinity() : value / count;
  }
  std::vector<size_t> order(choices.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](size_t a, size_t b) {
    return left.at(choices[a].scene) > left.at(choices[b].scene);
  });
  return order;
}

}  // namespace sheaf::coordinator
