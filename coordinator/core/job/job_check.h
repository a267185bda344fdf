// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Whether a job is one that the farm can do: its numbers make sense, and none is beyond a limit of
// limits.h. Errors say what to change.
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "coordinator/core/job/job.h"
#include "coordinator/core/job/limits.h"

namespace sheaf::coordinator {

// The most light passes of a lease, a power of two: the part of so many is as large as the frame. 0
// if that of one is larger than the limit.
uint64_t LightPassesMax(const FrameSettings& settings, const Limits& limits);

// Checks partition and frames. Errors: kInvalidArgument, kResourceExhausted.
absl::Status CheckJobSpec(const JobSpec& spec, const Limits& limits);

}  // namespace sheaf::coordinator
