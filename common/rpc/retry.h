// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Repeats a call that failed for a transient reason. The loop is pure: clock, sleep and randomness
// are arguments, so tests neither wait nor vary. Only idempotent calls may be repeated, and the
// caller states this at each call.
#pragma once

#include <functional>

#include "absl/status/status.h"
#include "absl/time/time.h"
#include "common/base/steady_time.h"

namespace sheaf {

// Limits of one retried call.
struct RetryPolicy {
  absl::Duration backoff_initial = absl::Milliseconds(100);
  absl::Duration backoff_max = absl::Seconds(5);
  double backoff_multiplier = 2.0;
  absl::Duration elapsed_max = absl::Minutes(2);  // No attempt starts later than this.
  int attempts_max = 100;
};

// The loop's access to clock, sleep and randomness.
struct RetryEnvironment {
  std::function<SteadyTime()> now;
  // Waits; returns false if the wait was interrupted because the program stops.
  std::function<bool(absl::Duration)> sleep;
  // Uniform in [0, 1): spreads the retries of clients that failed at the same moment.
  std::function<double()> uniform;
};
// The system's steady clock, a plain sleep and a generator seeded from the system.
RetryEnvironment SystemRetryEnvironment();

// Whether repeating the same request is harmless.
enum class Idempotency { kIdempotent, kNotIdempotent };

// Whether a later attempt may succeed by itself: kUnavailable, and kResourceExhausted that says
// after which time (retry_after.h). Full disks and limits of what a user has stay as they are.
bool IsTransient(const absl::Status& status);

// Calls until it succeeds, fails permanently, or a limit of the policy is reached. Returns the last
// status; if a limit ended the loop, the message gives the number of attempts. Waits backoff *
// [0.5, 1) between attempts, with backoff growing from backoff_initial to backoff_max; no less than
// a status asks for.
absl::Status RetryLoop(const RetryPolicy& policy, Idempotency idempotency,
                       const RetryEnvironment& environment,
                       const std::function<absl::Status()>& call);

}  // namespace sheaf
