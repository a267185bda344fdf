// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Whether a job is one that the farm can do: its numbers make sense, and none is beyond a limit of
// limits.h. Errors say what to change.
#pragma once

#include "absl/status/status.h"
#include "coordinator/core/job.h"
#include "coordinator/core/limits.h"

namespace sheaf::coordinator {

// Checks partition and frames. Errors: kInvalidArgument, kResourceExhausted.
absl::Status CheckJobSpec(const JobSpec& spec, const Limits& limits);

}  // namespace sheaf::coordinator
