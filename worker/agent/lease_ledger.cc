// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/lease_ledger.h"

#include <algorithm>
#include <set>
#include <utility>

#include "common/base/check.h"

namespace sheaf::worker {
namespace {

bool IsRunning(LeasePhase phase) {
  return phase == LeasePhase::kLoading || phase == LeasePhase::kRendering;
}

}  // namespace

LeaseLedger::Snapshot LeaseLedger::TakeSnapshot() {
  Snapshot snapshot;
  snapshot.sequence = ++sequence_;
  for (const auto& [id, held] : held_) {
    if (!held.dropped) snapshot.leases.push_back({id, held.phase});
  }
  for (const Failed& failed : failures_) snapshot.failures.push_back(failed.failure);
  return snapshot;
}

int LeaseLedger::Apply(uint64_t sequence, const std::vector<Lease>& desired) {
  int new_count = 0;
  std::set<uint64_t> listed;
  for (const Lease& lease : desired) {
    listed.insert(lease.lease_id);
    if (held_.contains(lease.lease_id) || ended_.contains(lease.lease_id)) continue;
    Held& held = held_[lease.lease_id];
    held.lease = lease;
    held.order = ++arrivals_;
    ++new_count;
  }
  for (auto it = held_.begin(); it != held_.end();) {
    const auto here = it++;
    Held& held = here->second;
    if (listed.contains(here->first)) continue;
    if (IsRunning(held.phase)) {
      held.dropped = true;
      held.stop.request_stop();
    } else if (held.phase == LeasePhase::kQueued) {
      Remove(here);
    }
  }
  // The coordinator now knows of every lease that ended before this request was made.
  std::erase_if(ended_, [&](const auto& entry) { return entry.second < sequence; });
  std::erase_if(failures_, [&](const Failed& failed) { return failed.sequence < sequence; });
  return new_count;
}

std::optional<LeaseLedger::Task> LeaseLedger::TakeNext() {
  Held* first = nullptr;
  for (auto& [id, held] : held_) {
    if (held.phase != LeasePhase::kQueued) continue;
    if (first == nullptr || held.order < first->order) first = &held;
  }
  if (first == nullptr) return std::nullopt;
  first->phase = LeasePhase::kLoading;
  return Task{first->lease, first->stop.get_token()};
}

void LeaseLedger::BeginRendering(uint64_t lease_id) {
  const auto it = held_.find(lease_id);
  SHEAF_CHECK(it != held_.end() && it->second.phase == LeasePhase::kLoading);
  it->second.phase = LeasePhase::kRendering;
}

void LeaseLedger::Finish(uint64_t lease_id) {
  const auto it = held_.find(lease_id);
  SHEAF_CHECK(it != held_.end() && it->second.phase == LeasePhase::kRendering);
  it->second.phase = LeasePhase::kUploading;
  it->second.dropped = false;
}

void LeaseLedger::Acknowledge(uint64_t lease_id) {
  const auto it = held_.find(lease_id);
  SHEAF_CHECK(it != held_.end() && it->second.phase == LeasePhase::kUploading);
  Remove(it);
}

void LeaseLedger::Fail(uint64_t lease_id, FailureKind kind, std::string message,
                       CacheShortage shortage) {
  const auto it = held_.find(lease_id);
  SHEAF_CHECK(it != held_.end());
  if (!it->second.dropped) {
    failures_.push_back(
        {{lease_id, kind, std::move(message), it->second.lease.token, shortage}, sequence_});
  }
  Remove(it);
}

void LeaseLedger::ReleaseQueued() {
  for (auto it = held_.begin(); it != held_.end();) {
    const auto here = it++;
    if (here->second.phase != LeasePhase::kQueued) continue;
    Fail(here->first, FailureKind::kReleased, "the worker gives it back");
  }
}

void LeaseLedger::StopRunning() {
  for (auto& [id, held] : held_) {
    if (IsRunning(held.phase)) held.stop.request_stop();
  }
}

bool LeaseLedger::HasQueued() const { return CountHeld(LeasePhase::kQueued) > 0; }

bool LeaseLedger::HasRunning() const {
  return CountHeld(LeasePhase::kLoading) + CountHeld(LeasePhase::kRendering) > 0;
}

int LeaseLedger::CountHeld(LeasePhase phase) const {
  return static_cast<int>(std::count_if(
      held_.begin(), held_.end(), [&](const auto& entry) { return entry.second.phase == phase; }));
}

void LeaseLedger::Remove(std::map<uint64_t, Held>::iterator it) {
  ended_[it->first] = sequence_;
  held_.erase(it);
}

}  // namespace sheaf::worker
