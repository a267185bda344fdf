// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/scheduling/lease_table.h"

#include "common/base/check.h"

namespace sheaf::coordinator {

LeaseTable::HedgeKey LeaseTable::KeyOf(const TaskId& task) const {
  const std::vector<uint64_t>& holders = holders_.at(task);
  const Lease& first = leases_.at(holders.front());
  return {holders.size(), first.is_check, first.phase != LeasePhase::kQueued, first.grant_time,
          first.lease_id};
}

const Lease& LeaseTable::Add(Lease lease) {
  lease.lease_id = next_lease_id_++;
  const TaskId task = MakeTaskId(lease.frame, lease.task);
  by_job_[lease.frame.job_id].insert(lease.lease_id);
  ++count_by_identity_[lease.identity];
  const Lease& stored = leases_.emplace(lease.lease_id, lease).first->second;
  std::vector<uint64_t>& holders = holders_[task];
  if (!holders.empty()) hedgeable_.erase(KeyOf(task));
  holders.push_back(stored.lease_id);
  hedgeable_.insert(KeyOf(task));
  return stored;
}

const Lease* LeaseTable::Find(uint64_t lease_id) const {
  const auto found = leases_.find(lease_id);
  return found == leases_.end() ? nullptr : &found->second;
}

void LeaseTable::SetPhase(uint64_t lease_id, LeasePhase phase) {
  Lease& lease = leases_.at(lease_id);
  const TaskId task = MakeTaskId(lease.frame, lease.task);
  hedgeable_.erase(KeyOf(task));
  lease.phase = phase;
  hedgeable_.insert(KeyOf(task));
}

int LeaseTable::Remove(uint64_t lease_id) {
  const auto found = leases_.find(lease_id);
  SHEAF_CHECK(found != leases_.end());
  const Lease lease = found->second;
  const TaskId task = MakeTaskId(lease.frame, lease.task);
  hedgeable_.erase(KeyOf(task));
  leases_.erase(found);
  const auto identity = count_by_identity_.find(lease.identity);
  if (--identity->second == 0) count_by_identity_.erase(identity);
  const auto job = by_job_.find(lease.frame.job_id);
  job->second.erase(lease_id);
  if (job->second.empty()) by_job_.erase(job);
  const auto holders = holders_.find(task);
  std::erase(holders->second, lease_id);
  const int left = static_cast<int>(holders->second.size());
  if (left == 0) {
    holders_.erase(holders);
  } else {
    hedgeable_.insert(KeyOf(task));
  }
  return left;
}

std::vector<uint64_t> LeaseTable::HoldersOf(const TaskId& task) const {
  const auto found = holders_.find(task);
  return found == holders_.end() ? std::vector<uint64_t>{} : found->second;
}

std::vector<uint64_t> LeaseTable::OfJob(uint64_t job_id) const {
  const auto found = by_job_.find(job_id);
  if (found == by_job_.end()) return {};
  return {found->second.begin(), found->second.end()};
}

size_t LeaseTable::CountOfJob(uint64_t job_id) const {
  const auto found = by_job_.find(job_id);
  return found == by_job_.end() ? 0 : found->second.size();
}

size_t LeaseTable::CountOfIdentity(const std::string& identity) const {
  const auto found = count_by_identity_.find(identity);
  return found == count_by_identity_.end() ? 0 : found->second;
}

}  // namespace sheaf::coordinator
