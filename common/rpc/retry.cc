// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "common/rpc/retry.h"

#include <algorithm>
#include <memory>
#include <random>

#include "absl/strings/str_cat.h"
#include "absl/time/clock.h"
#include "common/base/retry_after.h"

namespace sheaf {

RetryEnvironment SystemRetryEnvironment() {
  auto generator = std::make_shared<std::mt19937_64>(std::random_device{}());
  RetryEnvironment environment;
  environment.now = [] { return SteadyTime::Now(); };
  environment.sleep = [](absl::Duration duration) {
    absl::SleepFor(duration);
    return true;
  };
  environment.uniform = [generator] {
    return std::uniform_real_distribution<double>(0.0, 1.0)(*generator);
  };
  return environment;
}

bool IsTransient(const absl::Status& status) {
  return absl::IsUnavailable(status) || RetryAfterOf(status).has_value();
}

absl::Status RetryLoop(const RetryPolicy& policy, Idempotency idempotency,
                       const RetryEnvironment& environment,
                       const std::function<absl::Status()>& call) {
  const SteadyTime deadline = environment.now() + policy.elapsed_max;
  absl::Duration backoff = policy.backoff_initial;
  for (int attempt = 1;; ++attempt) {
    absl::Status status = call();
    if (status.ok() || !IsTransient(status)) return status;
    if (idempotency == Idempotency::kNotIdempotent) return status;
    const absl::Duration wait = std::max(backoff * (0.5 + 0.5 * environment.uniform()),
                                         RetryAfterOf(status).value_or(absl::ZeroDuration()));
    const bool exhausted = attempt >= policy.attempts_max || environment.now() + wait > deadline;
    if (exhausted || !environment.sleep(wait)) {
      return {status.code(), absl::StrCat(status.message(), " (gave up after ", attempt,
                                          attempt == 1 ? " attempt)" : " attempts)")};
    }
    backoff = std::min(backoff * policy.backoff_multiplier, policy.backoff_max);
  }
}

}  // namespace sheaf
