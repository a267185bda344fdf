// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/core/job/owner_work.h"

#include "absl/strings/str_cat.h"
#include "coordinator/core/job/job_approval.h"

namespace sheaf::coordinator {
namespace {

absl::Status TooMuchError(uint64_t present, uint64_t more, const char* what, uint64_t limit) {
  return absl::ResourceExhaustedError(absl::StrCat("your unfinished jobs have ", present, " ", what,
                                                   "; ", more, " more would exceed ", limit,
                                                   ", the limit of a user; wait until some have "
                                                   "ended, or cancel some"));
}

}  // namespace

OwnerWork& OwnerWork::operator+=(const OwnerWork& other) {
  jobs += other.jobs;
  frames += other.frames;
  samples += other.samples;
  return *this;
}

OwnerWork& OwnerWork::operator-=(const OwnerWork& other) {
  jobs -= other.jobs;
  frames -= other.frames;
  samples -= other.samples;
  return *this;
}

OwnerWork WorkOf(const JobSpec& spec) {
  OwnerWork work{1, static_cast<int64_t>(spec.frames.size()), 0};
  for (const FrameSpec& frame : spec.frames) {
    const bool waits = IsUnapproved(spec, frame.frame_number);
    work.samples +=
        PathsPerSample(frame.settings) *
        (waits ? spec.approvals.at(frame.frame_number).samples : frame.settings.samples);
  }
  return work;
}

absl::Status CheckOwnerWork(const OwnerWork& present, const OwnerWork& more, const Limits& limits) {
  const auto exceeds = [](auto have, auto adding, auto limit) {
    return have > limit || adding > limit - have;  // Without overflow.
  };
  if (exceeds(present.jobs, more.jobs, limits.owner_jobs_max)) {
    return TooMuchError(static_cast<uint64_t>(present.jobs), static_cast<uint64_t>(more.jobs),
                        "jobs", static_cast<uint64_t>(limits.owner_jobs_max));
  }
  if (exceeds(present.frames, more.frames, limits.owner_frames_max)) {
    return TooMuchError(static_cast<uint64_t>(present.frames), static_cast<uint64_t>(more.frames),
                        "frames", static_cast<uint64_t>(limits.owner_frames_max));
  }
  if (exceeds(present.samples, more.samples, limits.owner_samples_max)) {
    return TooMuchError(present.samples, more.samples, "samples", limits.owner_samples_max);
  }
  return absl::OkStatus();
}

}  // namespace sheaf::coordinator
