// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// TaskFailures: the workers that failed a task so far, and how. Decides which workers may still
// render it.
#pragma once

#include <map>
#include <set>
#include <string>

#include "common/base/steady_time.h"
#include "coordinator/core/job/job.h"
#include "coordinator/core/job/limits.h"

namespace sheaf::coordinator {

struct TaskFailures {
  TaskTrouble trouble;  // Its durable part.
  // Workers that are to blame if another one renders the task, with their messages.
  std::map<std::string, std::string> suspects;
  std::string last_words;  // For users; empty if there is no failure.
  int attempt_count = 0;   // Leases without a result since the coordinator started.
  SteadyTime not_before = SteadyTime::InfinitePast();

  // Counts a failure of any class except released, loading and scene.
  void Add(const std::string& worker_id, const std::string& identity, FailureKind kind,
           const std::string& words);
  int CountOf(FailureKind kind) const;
  // Distinct identities that failed it by this class.
  int IdentityCountOf(FailureKind kind) const;
  // Those that failed it by any class that names the worker.
  std::set<std::string> Identities() const;
  std::set<std::string> Workers() const;
  // Whether the worker failed it by a crash, lack of memory or an invalid result.
  bool IsFailedBy(const std::string& worker_id) const;
  bool HasInfrastructureFailureOf(const std::string& worker_id) const;
  // Whether a budget is used up.
  bool IsPoison(const Limits& limits) const;
  // "a by a crash, b by lack of memory"; of classes that name the worker.
  std::string Text() const;
};

}  // namespace sheaf::coordinator
