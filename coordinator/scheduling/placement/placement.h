// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Placement: which work of equal priority a worker gets, so that it rarely has to load a scene. A
// worker is warm for a scene that it has in memory or holds a lease of. Its first lease of any
// other scene is a cold start.
//
// A bounded form of delay scheduling (Zaharia et al. 2010, "Delay Scheduling: A Simple Technique
// for Achieving Locality and Fairness in Cluster Scheduling", EuroSys): a worker that has just
// loaded a scene keeps to work that it is warm for, to make the loading worthwhile, and passes over
// jobs that are next in order:
//
//     the next job is warm                the worker takes it
//     the worker began a scene lately     it stays warm, and the job waits
//     the next job has waited for long    the worker takes it
//     otherwise                           the worker takes it
//
// Unlike there, a job does not wait for the workers that are warm for it: they may all be busy with
// it, and it would get less than its share while other workers are free.
//
// Thread safety: none; the owner holds one lock. Cost: O(log n) a call, or linear where it says so.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "absl/container/btree_set.h"
#include "common/base/steady_time.h"
#include "coordinator/core/job/limits.h"

namespace sheaf::coordinator {

// How many workers are warm for a scene. Scenes are hex digests of manifests.
class WarmWorkers {
 public:
  // Replaces what the worker is warm for; without scenes it is forgotten. Linear in the scenes.
  void Set(const std::string& worker_id, const std::string& numeric_profile,
           const std::set<std::string>& scenes);
  int CountOf(const std::string& numeric_profile, const std::string& scene) const;

 private:
  using Keys = std::set<std::string>;  // Profile and scene.
  std::map<std::string, Keys> keys_of_;
  std::map<std::string, int> counts_;
};

// The jobs that have work of a scene.
class SceneJobs {
 public:
  void Set(const std::string& scene, uint64_t job_id, bool has_work);
  // Ascending. Valid until the next Set.
  const absl::btree_set<uint64_t>& Of(const std::string& scene) const;
  size_t scene_count() const { return jobs_.size(); }

 private:
  std::map<std::string, absl::btree_set<uint64_t>> jobs_;
};

// Whether a worker that is cold for the next job may take warm work instead.
struct PassingOver {
  SteadyTime worker_cold_time;  // When the worker last began a scene; InfinitePast: never.
  SteadyTime job_passed_time;   // Since when the job has been passed over; InfiniteFuture: not.
};
bool MayPassOver(const PassingOver& state, SteadyTime now, const Limits& limits);

// Work that a worker is cold for.
struct ColdWork {
  std::string scene;        // The scene of its first lease.
  double samples_left = 0;  // Pixel samples that can be leased.
};
// Returns the indices of `choices` in the order in which a cold worker tries them. `choices` are in
// order of right. First come scenes that no worker is warm for, in their given order; then the
// others, by descending work left of the scene per worker that is warm for it.
std::vector<size_t> ColdOrder(std::span<const ColdWork> choices,
                              const std::function<int(const std::string& scene)>& warm_count);

}  // namespace sheaf::coordinator
