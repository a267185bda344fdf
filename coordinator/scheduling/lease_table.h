// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LeaseTable: the live leases, by id, by task and by job, and the candidates for a second holder
// (hedges).
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

// Names a task in the whole farm.
struct TaskId {
  FrameId frame;
  uint32_t tile = 0;
  uint64_t first = 0;
  uint64_t count = 0;
  uint64_t cells = 1;
  friend auto operator<=>(const TaskId&, const TaskId&) = default;
};
inline TaskId MakeTaskId(const FrameId& frame, const Task& task) {
  return {frame, task.tile, task.block.first, task.block.count, task.cells};
}

inline Task TaskOf(const TaskId& id) { return {id.tile, {id.first, id.count}, id.cells}; }

class LeaseTable {
 public:
  explicit LeaseTable(uint64_t first_lease_id) : next_lease_id_(first_lease_id) {}

  // Adds the lease under a new id and returns it as stored.
  const Lease& Add(Lease lease);
  const Lease* Find(uint64_t lease_id) const;
  void SetPhase(uint64_t lease_id, LeasePhase phase);
  // Removes a lease. Returns how many leases still hold its task.
  int Remove(uint64_t lease_id);

  std::vector<uint64_t> HoldersOf(const TaskId& task) const;
  std::vector<uint64_t> OfJob(uint64_t job_id) const;
  size_t CountOfJob(uint64_t job_id) const;
  size_t CountOfIdentity(const std::string& identity) const;
  size_t size() const { return leases_.size(); }

  // The first lease of each leased task. Order: tasks with fewer holders first, then leases other
  // than checks, then those that have not begun, then the oldest.
  using HedgeKey = std::tuple<size_t, bool, bool, SteadyTime, uint64_t>;
  static uint64_t LeaseIdOf(const HedgeKey& key) { return std::get<4>(key); }
  const std::set<HedgeKey>& hedgeable() const { return hedgeable_; }

 private:
  // Requires: a lease holds the task.
  HedgeKey KeyOf(const TaskId& task) const;

  uint64_t next_lease_id_;
  std::unordered_map<uint64_t, Lease> leases_;
  std::map<TaskId, std::vector<uint64_t>> holders_;
  std::map<uint64_t, std::set<uint64_t>> by_job_;
  std::map<std::string, size_t> count_by_identity_;
  std::set<HedgeKey> hedgeable_;
};

}  // namespace sheaf::coordinator
