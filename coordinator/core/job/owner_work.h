// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// OwnerWork: the sums over one user's unfinished jobs, and their limits, so that no user fills the
// coordinator's tables.
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "coordinator/core/job/job.h"
#include "coordinator/core/job/limits.h"

namespace sheaf::coordinator {

struct OwnerWork {
  int64_t jobs = 0;  // Pilots included.
  int64_t frames = 0;
  uint64_t samples = 0;  // Requested pixel samples, including rendered ones.

  OwnerWork& operator+=(const OwnerWork& other);
  OwnerWork& operator-=(const OwnerWork& other);
  friend bool operator==(const OwnerWork&, const OwnerWork&) = default;
};

// The work that a job holds until it ends. Requires: CheckJobSpec is OK.
OwnerWork WorkOf(const JobSpec& spec);

// Whether the owner of `present` may add `more`. Errors: kResourceExhausted, naming the limit.
absl::Status CheckOwnerWork(const OwnerWork& present, const OwnerWork& more, const Limits& limits);

}  // namespace sheaf::coordinator
