// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Counts of events since the start, by name. Every way in which work can be lost has a counter of
// its own, so that every loss is visible.
#pragma once

#include <array>
#include <cstdint>

#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

struct Counters {
  uint64_t synchronize_calls = 0;
  uint64_t leases_granted = 0;    // Hedges included.
  uint64_t leases_cold = 0;       // The worker did not have the scene (placement.h).
  uint64_t leases_hedged = 0;     // Second leases of a task.
  uint64_t leases_expired = 0;    // The worker fell silent or the lease grew too old.
  uint64_t leases_cancelled = 0;  // Another result covers them, or the job ended.
  uint64_t results_accepted = 0;
  uint64_t results_duplicate_equal = 0;
  uint64_t results_duplicate_mismatch = 0;
  uint64_t results_superseded = 0;
  uint64_t results_late = 0;         // Accepted although their lease had ended.
  uint64_t results_invalid = 0;      // Not a part of the key they came with.
  uint64_t results_other_field = 0;  // Made with another guiding field than the frame's: refused.
  uint64_t results_refused = 0;      // Not leased to the sender, or of a quarantined one.
  uint64_t failures_refused = 0;     // Not of a lease of the sender.
  uint64_t checks_begun = 0;
  uint64_t checks_dropped = 0;    // No worker could do them in time.
  uint64_t samples_checked = 0;   // Pixel samples rendered for checks.
  uint64_t parts_revoked = 0;     // Rows whose part is missing or damaged: rendered again.
  uint64_t parts_unrecorded = 0;  // Files whose rows are not there: rendered again.
  uint64_t commits_lost = 0;      // Database commits lost by damage to its log; an upper bound.
  uint64_t fields_trained = 0;    // Guiding fields that are durable.
  uint64_t workers_lost = 0;
  uint64_t workers_quarantined = 0;
  uint64_t workers_sick = 0;
  uint64_t tasks_poisoned = 0;     // Set aside because workers failed them.
  uint64_t tasks_killed = 0;       // Set aside by users.
  uint64_t tasks_retried = 0;      // Retried by users.
  uint64_t frames_incomplete = 0;  // Ended with tasks that are set aside.
  uint64_t samples_accepted = 0;   // Pixel samples.
  uint64_t rays_accepted = 0;
  uint64_t nonfinite_samples = 0;
  uint64_t jobs_refused = 0;  // Their owners have too much unfinished work.
  uint64_t frames_delivered = 0;
  uint64_t scenes_lost = 0;  // Scenes of live jobs with a file that is damaged or lost.
  std::array<uint64_t, kFailureKindCount> failures{};  // By FailureKind.
};

}  // namespace sheaf::coordinator
