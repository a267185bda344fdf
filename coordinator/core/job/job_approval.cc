// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/job_approval.h"

#include <bit>

#include "absl/strings/str_cat.h"

namespace sheaf::coordinator {
namespace {

// Empty if the frame can wait for approval after this many samples.
std::string WhyNoApproval(uint64_t samples, const FrameSpec& frame) {
  if (frame.stop.IsActive()) {
    return "is ended by a target error, a time or a budget; approval needs a number of samples";
  }
  if (!frame.resumed.sha256_hex.empty()) {
    return "resumes an image, which has its first samples already";
  }
  if (samples >= frame.settings.samples) {
    return absl::StrCat("has ", frame.settings.samples, " samples in all; wait after fewer");
  }
  return "";
}

}  // namespace

absl::Status HoldForApproval(uint64_t samples, JobSpec* spec) {
  if (samples == 0) return absl::OkStatus();
  if (!std::has_single_bit(samples)) {
    return absl::InvalidArgumentError(absl::StrCat("approve_after: ", samples,
                                                   " samples are not a power of two; choose ",
                                                   std::bit_floor(samples)));
  }
  if (spec->pilot) return absl::InvalidArgumentError("approve_after: not allowed for pilots");
  for (FrameSpec& frame : spec->frames) {
    if (const std::string why = WhyNoApproval(samples, frame); !why.empty()) {
      return absl::InvalidArgumentError(
          absl::StrCat("approve_after: frame ", frame.frame_number, " ", why));
    }
    spec->approvals[frame.frame_number] = {frame.settings.samples, /*approved=*/false};
    frame.settings.samples = samples;
  }
  return absl::OkStatus();
}

bool IsUnapproved(const JobSpec& spec, int32_t frame_number) {
  const auto approval = spec.approvals.find(frame_number);
  return approval != spec.approvals.end() && !approval->second.approved;
}

std::vector<FrameSpec> ApprovedFrames(const JobSpec& spec) {
  std::vector<FrameSpec> frames = spec.frames;
  for (FrameSpec& frame : frames) {
    if (!IsUnapproved(spec, frame.frame_number)) continue;
    frame.settings.samples = spec.approvals.at(frame.frame_number).samples;
  }
  return frames;
}

}  // namespace sheaf::coordinator
