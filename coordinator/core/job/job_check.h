// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Checks that the farm can do a job: its numbers are valid, and none exceeds a limit of limits.h.
// Errors say what to change.
#pragma once

#include <cstdint>

#include "absl/status/status.h"
#include "coordinator/core/job/job.h"
#include "coordinator/core/job/limits.h"

namespace sheaf::coordinator {

// The maximum number of light passes of a lease, or of passes of a stereo frame, a power of two;
// their part is as large as the frame. 0 if the part of one pass exceeds the limit.
uint64_t LightPassesMax(const FrameSettings& settings, const Limits& limits);

// Checks partition and frames. Errors: kInvalidArgument, kResourceExhausted.
absl::Status CheckJobSpec(const JobSpec& spec, const Limits& limits);

}  // namespace sheaf::coordinator
