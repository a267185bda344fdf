// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// LeaseLedger: which leases this worker holds and what it says about them. Pure decisions: no
// clock, no thread, no transport. Leases enter through Apply alone and leave when they are
// acknowledged, when they failed, or when the coordinator no longer lists them.
//
// A reply can be older than what happened while it travelled: it may list a lease that has ended
// since its request was made. Ended leases are therefore remembered until a younger request is
// answered.
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
  // What a request says; Apply wants its sequence back.
  struct Snapshot {
    uint64_t sequence = 0;
    std::vector<LeaseReport> leases;
    std::vector<LeaseFailure> failures;
  };
  Snapshot TakeSnapshot();
  // Set by the last snapshot.
  uint64_t sequence() const { return sequence_; }

  // Takes over the answer to that request: new leases are queued in the answer's order, queued and
  // running leases it does not list are dropped (running ones are asked to stop). Finished parts
  // stay: a result is wanted or superseded, and both are the coordinator's to say. Returns how many
  // leases are new.
  int Apply(uint64_t sequence, const std::vector<Lease>& desired);

  // A task to render and the token that tells when it is no longer wanted.
  struct Task {
    Lease lease;
    std::stop_token stop;
  };
  // The first queued lease, which becomes kLoading; nothing where none is queued.
  std::optional<Task> TakeNext();
  void BeginRendering(uint64_t lease_id);
  // The part is in the outbox now.
  void Finish(uint64_t lease_id);
  // The coordinator has the part, or will never want it.
  void Acknowledge(uint64_t lease_id);
  // Ends a lease without a result, in whatever phase. One that was dropped meanwhile leaves no
  // trace.
  void Fail(uint64_t lease_id, FailureKind kind, std::string message);

  // Hands back what nobody has begun.
  void ReleaseQueued();
  // Asks the threads to stop what they load or render; they then Fail it.
  void StopRunning();

  bool HasQueued() const;
  // Whether a thread loads or renders.
  bool HasRunning() const;
  // Whether neither a lease nor an unanswered failure is left.
  bool Empty() const { return held_.empty() && failures_.empty(); }
  int CountHeld(LeasePhase phase) const;

 private:
  struct Held {
    Lease lease;
    LeasePhase phase = LeasePhase::kQueued;
    std::stop_source stop;
    uint64_t order = 0;  // Of arrival: the coordinator's priority.
    bool dropped = false;
  };
  struct Failed {
    LeaseFailure failure;
    uint64_t sequence = 0;  // Of the last snapshot before it.
  };
  // Also remembers the lease as ended.
  void Remove(std::map<uint64_t, Held>::iterator it);

  std::map<uint64_t, Held> held_;       // By lease id.
  std::map<uint64_t, uint64_t> ended_;  // Lease id to the sequence of the last snapshot before.
  std::vector<Failed> failures_;        // Until answered.
  uint64_t sequence_ = 0;
  uint64_t arrivals_ = 0;
};

}  // namespace sheaf::worker
