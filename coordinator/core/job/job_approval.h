// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Approval after a first pass: each frame of such a job gets a power of two of samples first, and
// is delivered. The rest is rendered where a person approves the image. Samples depend on their
// index alone, so that the final image has the same bits as one without approval.
#pragma once

#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "coordinator/core/job/job.h"

namespace sheaf::coordinator {

// Has each frame of the job wait after so many samples a pixel; 0 changes nothing. Errors:
// kInvalidArgument.
absl::Status HoldForApproval(uint64_t samples, JobSpec* spec);

// Whether the frame waits for approval once it is delivered.
bool IsUnapproved(const JobSpec& spec, int32_t frame_number);

// The job's frames with the samples that they have once all are approved.
std::vector<FrameSpec> ApprovedFrames(const JobSpec& spec);

}  // namespace sheaf::coordinator
