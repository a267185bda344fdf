// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/sharing/requirement_groups.h"

#include <algorithm>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/check.h"
#include "common/base/memory_room.h"

namespace sheaf::coordinator {
namespace {

// Pools of workers that a message names.
constexpr size_t kPoolsToldMax = 8;

bool HasTags(const WorkerTraits& worker, const std::vector<std::string>& tags) {
  return std::ranges::includes(worker.tags, tags);
}

// The tags that none of these workers has or, if each tag has a worker, all of them.
std::string MissingTags(const Requirements& requirements,
                        const std::vector<const WorkerTraits*>& workers) {
  std::vector<std::string> missing;
  for (const std::string& tag : requirements.tags) {
    const bool is_there = std::ranges::any_of(
        workers, [&](const WorkerTraits* worker) { return HasTags(*worker, {tag}); });
    if (!is_there) missing.push_back(tag);
  }
  if (missing.size() == 1) return absl::StrCat("has the tag \"", missing[0], "\"");
  const std::vector<std::string>& told = missing.empty() ? requirements.tags : missing;
  return absl::StrCat("has all of the tags ", absl::StrJoin(told, ", "));
}

}  // namespace

bool Fits(const Requirements& requirements, const WorkerTraits& worker) {
  return requirements.pool == worker.pool && HasTags(worker, requirements.tags) &&
         requirements.memory_min_bytes <= worker.memory_bytes;
}

void WorkerKinds::Count(const std::string& numeric_profile, const WorkerTraits& worker, int sign) {
  const auto kind = live_.try_emplace({numeric_profile, worker}, 0).first;
  kind->second += sign;
  SHEAF_CHECK(kind->second >= 0);
  if (kind->second == 0) live_.erase(kind);
}

int WorkerKinds::LiveCount(const std::string& numeric_profile,
                           const Requirements& requirements) const {
  int count = 0;
  for (auto it = live_.lower_bound({numeric_profile, {"", {}, 0}});
       it != live_.end() && it->first.first == numeric_profile; ++it) {
    if (Fits(requirements, it->first.second)) count += it->second;
  }
  return count;
}

bool WorkerKinds::HaveExpectedMemory(const std::string& numeric_profile,
                                     const Requirements& requirements, int kinds_max) const {
  int scanned = 0;
  for (auto it = live_.lower_bound({numeric_profile, {requirements.pool, {}, 0}});
       it != live_.end() && it->first.first == numeric_profile &&
       it->first.second.pool == requirements.pool;
       ++it) {
    if (++scanned > kinds_max) return false;
    const WorkerTraits& worker = it->first.second;
    if (Fits(requirements, worker) && worker.memory_bytes >= requirements.memory_expected_bytes) {
      return true;
    }
  }
  return false;
}

std::string WorkerKinds::WhyNone(const std::string& numeric_profile,
                                 const Requirements& requirements) const {
  std::set<std::string> pools;
  std::vector<const WorkerTraits*> of_pool, with_tags;
  uint64_t memory_most = 0;
  for (const auto& [kind, count] : live_) {
    const WorkerTraits& worker = kind.second;
    if (kind.first != numeric_profile) continue;
    if (Fits(requirements, worker)) return "";
    pools.insert(worker.pool);
    if (worker.pool != requirements.pool) continue;
    of_pool.push_back(&worker);
    if (!HasTags(worker, requirements.tags)) continue;
    with_tags.push_back(&worker);
    memory_most = std::max(memory_most, worker.memory_bytes);
  }
  if (pools.empty()) return "";
  if (of_pool.empty()) {
    const bool all = pools.size() <= kPoolsToldMax;
    std::vector<std::string> told(pools.begin(), pools.end());
    if (!all) told.resize(kPoolsToldMax);
    return absl::StrCat("no worker of the pool \"", requirements.pool,
                        "\" is connected; the connected workers are of ", absl::StrJoin(told, ", "),
                        all ? "" : " and others");
  }
  const std::string in_pool =
      absl::StrCat("no connected worker of the pool \"", requirements.pool, "\" ");
  if (with_tags.empty()) return absl::StrCat(in_pool, MissingTags(requirements, of_pool));
  return absl::StrCat(in_pool, requirements.tags.empty() ? "" : "with the job's tags ", "gives ",
                      FormatMemory(requirements.memory_min_bytes),
                      " of memory to scenes; the most ", "that one gives is ",
                      FormatMemory(memory_most), " (sheaf-worker ", "--scene-memory-max)");
}

int RequirementGroups::Add(Requirements requirements) {
  requirements.memory_expected_bytes = RoundMemoryUp(requirements.memory_expected_bytes);
  const auto [group, is_new] = groups_.try_emplace(std::move(requirements));
  if (is_new) {
    group->second.id = next_id_++;
    by_id_[group->second.id] = group->first;
  }
  ++group->second.job_count;
  return group->second.id;
}

void RequirementGroups::Release(int group) {
  const auto by_id = by_id_.find(group);
  SHEAF_CHECK(by_id != by_id_.end());
  const auto found = groups_.find(by_id->second);
  if (--found->second.job_count > 0) return;
  groups_.erase(found);
  by_id_.erase(by_id);
}

bool RequirementGroups::HasRoom(Requirements requirements, size_t groups_max) const {
  if (groups_.size() < groups_max) return true;
  requirements.memory_expected_bytes = RoundMemoryUp(requirements.memory_expected_bytes);
  return groups_.contains(requirements);
}

std::vector<int> RequirementGroups::For(const std::string& numeric_profile,
                                        const WorkerTraits& worker, const WorkerKinds& kinds,
                                        int kinds_max) const {
  std::vector<int> fitting;
  for (const auto& [id, requirements] : by_id_) {
    if (!Fits(requirements, worker)) continue;
    const bool lacks_memory =
        worker.memory_bytes > 0 && worker.memory_bytes < requirements.memory_expected_bytes;
    if (lacks_memory && kinds.HaveExpectedMemory(numeric_profile, requirements, kinds_max)) {
      continue;
    }
    fitting.push_back(id);
  }
  return fitting;
}

}  // namespace sheaf::coordinator
