// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RequirementGroups: the jobs that a worker may render, by pool, tags and memory. Jobs with equal
// requirements form a group, so that a worker is compared with few groups, not with many jobs.
// WorkerKinds counts the live workers by their traits.
//
// Thread safety: none.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/core/job/requirements.h"

namespace sheaf::coordinator {

// Whether a worker meets the job's hard requirements; memory that is only expected does not count.
bool Fits(const Requirements& requirements, const WorkerTraits& worker);

class WorkerKinds {
 public:
  // sign: 1 for a worker that became live, -1 for one that is no longer live.
  void Count(const std::string& numeric_profile, const WorkerTraits& worker, int sign);
  // Live workers of the profile that fit.
  int LiveCount(const std::string& numeric_profile, const Requirements& requirements) const;
  // Whether any fitting worker has the expected memory. False beyond kinds_max kinds of workers, so
  // that the cost of a lease is bounded.
  bool HaveExpectedMemory(const std::string& numeric_profile, const Requirements& requirements,
                          int kinds_max) const;
  // Explains to users why none fits: the missing pool, tag or memory. Empty if one fits, or if the
  // profile has no workers.
  std::string WhyNone(const std::string& numeric_profile, const Requirements& requirements) const;

 private:
  using Kind = std::pair<std::string, WorkerTraits>;  // Numeric profile first.
  std::map<Kind, int> live_;
};

class RequirementGroups {
 public:
  // Counts one more job of the group, which may be new.
  int Add(Requirements requirements);
  // Counts one job less; removes a group without jobs.
  void Release(int group);
  // Whether the requirements belong to an existing group, or there is room for a new one.
  bool HasRoom(Requirements requirements, size_t groups_max) const;
  // The groups that a worker may be leased from, ascending. Omits a group whose expected memory the
  // worker lacks, while another live worker has it.
  std::vector<int> For(const std::string& numeric_profile, const WorkerTraits& worker,
                       const WorkerKinds& kinds, int kinds_max) const;

 private:
  struct Group {
    int id = 0;
    int job_count = 0;
  };
  std::map<Requirements, Group> groups_;
  std::map<int, Requirements> by_id_;
  int next_id_ = 0;
};

}  // namespace sheaf::coordinator
