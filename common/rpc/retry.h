// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Repeating a call that failed for a passing reason. The loop is pure: clock, sleep and randomness
// come in, so tests neither wait nor vary. Only idempotent calls may be repeated, and the caller
// says so at each call.
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
  absl::Duration elapsed_max = absl::Minutes(2);  // No attempt begins later than this.
  int attempts_max = 100;
};

// What the loop needs of the world.
struct RetryEnvironment {
  std::function<SteadyTime()> now;
  // Waits; returns false where the wait was cut short because the program stops.
  std::function<bool(absl::Duration)> sleep;
  // Uniform in [0, 1): spreads clients that failed at the same moment.
  std::function<double()> uniform;
};
// The system's steady clock, a plain sleep and a generator seeded from the system.
RetryEnvironment SystemRetryEnvironment();

// Whether a second delivery of the same request does no harm.
enum class Idempotency { kIdempotent, kNotIdempotent };

// Whether a later attempt may succeed: kUnavailable and kResourceExhausted.
bool IsTransient(const absl::Status& status);

// Calls until it succeeds, fails for good, or a limit of the policy is met.
// Returns the last status; where a limit ended it, the message says after how many attempts.
// Waits backoff * [0.5, 1) between attempts, backoff growing from backoff_initial to backoff_max.
absl::Status RetryLoop(const RetryPolicy& policy, Idempotency idempotency,
                       const RetryEnvironment& environment,
                       const std::function<absl::Status()>& call);

}  // namespace sheaf
