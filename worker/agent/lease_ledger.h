// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LeaseLedger: the leases that this worker holds, and its reports about them. Pure decisions: no
// clock, no thread, no transport. Leases enter only through Apply, and leave when they are
// acknowledged, fail, or are no longer listed by the coordinator.
//
// A reply may be outdated when it arrives: it may list a lease that has ended since the request was
// made. Ended leases are therefore remembered until a later request is answered.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <stop_token>
#include <vector>

#include "worker/agent/work.h"

namespace sheaf::worker {

class LeaseLedger {
 public:
  // The contents of a request; pass its sequence to Apply.
  struct Snapshot {
    uint64_t sequence = 0;
    std::vector<LeaseReport> leases;
    std::vector<LeaseFailure> failures;
  };
  Snapshot TakeSnapshot();
  // Sequence of the last snapshot.
  uint64_t sequence() const { return sequence_; }

  // Processes the reply to that request: queues new leases in the reply's order, and drops queued
  // and running leases that it does not list (running ones are requested to stop). Finished parts
  // stay: the coordinator decides whether a result is wanted or superseded. Returns the number of
  // new leases.
  int Apply(uint64_t sequence, const std::vector<Lease>& desired);

  // A task to render, and the token that requests its end.
  struct Task {
    Lease lease;
    std::stop_token stop;
  };
  // Returns the first queued lease, which becomes kLoading; none if the queue is empty.
  std::optional<Task> TakeNext();
  void BeginRendering(uint64_t lease_id);
  // Call once the part is in the outbox.
  void Finish(uint64_t lease_id);
  // Call once the coordinator has the part, or will never want it.
  void Acknowledge(uint64_t lease_id);
  // Ends a lease without a result, in any phase. No failure is reported for a lease that was
  // dropped meanwhile.
  void Fail(uint64_t lease_id, FailureKind kind, std::string message, CacheShortage shortage = {});

  // Returns all leases that no thread has begun.
  void ReleaseQueued();
  // Requests the threads to stop loading and rendering; they then call Fail.
  void StopRunning();

  bool HasQueued() const;
  // Whether a thread is loading or rendering.
  bool HasRunning() const;
  // Whether no lease and no unanswered failure is left.
  bool Empty() const { return held_.empty() && failures_.empty(); }
  int CountHeld(LeasePhase phase) const;

 private:
  struct Held {
    Lease lease;
    LeasePhase phase = LeasePhase::kQueued;
    std::stop_source stop;
    uint64_t order = 0;  // Order of arrival: the coordinator's priority.
    bool dropped = false;
  };
  struct Failed {
    LeaseFailure failure;
    uint64_t sequence = 0;  // The last snapshot before the failure.
  };
  // Also remembers the lease as ended.
  void Remove(std::map<uint64_t, Held>::iterator it);

  std::map<uint64_t, Held> held_;       // By lease id.
  std::map<uint64_t, uint64_t> ended_;  // Lease id to the sequence of the last snapshot before.
  std::vector<Failed> failures_;        // Until a reply confirms them.
  uint64_t sequence_ = 0;
  uint64_t arrivals_ = 0;
};

}  // namespace sheaf::worker
