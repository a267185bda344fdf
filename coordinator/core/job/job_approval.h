// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Approval after a first pass: each frame of such a job first gets a power of two of samples, and
// is delivered. The rest is rendered once a user approves the image. Samples depend only on their
// index, so the final image has the same bits as one without approval.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

// Makes each frame of the job wait after `samples` samples per pixel; 0 changes nothing. Errors:
// kInvalidArgument.
absl::Status HoldForApproval(uint64_t samples, JobSpec* spec);

// Whether the frame waits for approval once it is delivered.
bool IsUnapproved(const JobSpec& spec, int32_t frame_number);

// The job's frames with their samples after approval.
std::vector<FrameSpec> ApprovedFrames(const JobSpec& spec);

}  // namespace sheaf::coordinator
