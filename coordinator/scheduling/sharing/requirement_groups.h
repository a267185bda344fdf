// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// RequirementGroups: which jobs a worker may render, by pool, tags and memory. Jobs with equal
// requirements form a group, so that a worker is compared with few groups, not with many jobs.
// WorkerKinds counts the live workers by what they say of themselves.
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

// Whether a worker has what the job must have; memory that is only expected does not count.
bool Fits(const Requirements& requirements, const WorkerTraits& worker);

class WorkerKinds {
 public:
  // sign: 1 for a worker that is live now, -1 for one that is no more.
  void Count(const std::string& numeric_profile, const WorkerTraits& worker, int sign);
  // Live workers of the profile that fit.
  int LiveCount(const std::string& numeric_profile, const Requirements& requirements) const;
  // Whether one fits that has the memory which is expected to be needed. False beyond kinds_max
  // kinds of workers, so that the cost of a lease is bounded.
  bool HaveExpectedMemory(const std::string& numeric_profile, const Requirements& requirements,
                          int kinds_max) const;
  // Why none fits, for people: the pool, the tag or the memory that is missing. Empty where one
  // does, or where there is none of the profile.
  std::string WhyNone(const std::string& numeric_profile, const Requirements& requirements) const;

 private:
  using Kind = std::pair<std::string, WorkerTraits>;  // Numeric profile first.
  std::map<Kind, int> live_;
};

class RequirementGroups {
 public:
  // Counts one more job of the group, which may be new.
  int Add(Requirements requirements);
  // One less; a group without jobs is forgotten.
  void Release(int group);
  // Whether a job of these makes no new group, or there is room for one.
  bool HasRoom(Requirements requirements, size_t groups_max) const;
  // The groups that a worker may be leased from, ascending. One that has less memory than is
  // expected to be needed is left out while a live worker has it.
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
