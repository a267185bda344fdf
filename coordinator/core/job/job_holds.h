// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Plain values of what people hold work back by: jobs that wait for others, frames that wait for
// approval, and workers that are taken out (docs/scheduling.md).
#pragma once

#include <cstdint>
#include <string>

#include "absl/time/time.h"

namespace sheaf::coordinator {

// A job waits for another one.
struct JobDependency {
  uint64_t job_id = 0;    // The job that is waited for. Smaller than that of the one that waits.
  bool by_frame = false;  // Frame n waits for its frame n; otherwise the whole job for the whole.
  bool released = false;  // A person started the job that waits anyway.
  bool removed = false;   // The job that is waited for was delivered, and is removed since.
  friend bool operator==(const JobDependency&, const JobDependency&) = default;
};

// A frame that gets a part of its samples first, and the rest where a person approves that.
struct FrameApproval {
  uint64_t samples = 0;   // A pixel's, once it is approved.
  bool approved = false;  // Then the frame's settings have them.
  friend bool operator==(const FrameApproval&, const FrameApproval&) = default;
};

// A worker that gets no work, as a person takes it out.
struct DrainRecord {
  std::string worker_id;
  bool then_exit = false;  // It is told to end when it holds nothing more.
  absl::Time time = absl::InfinitePast();
  friend bool operator==(const DrainRecord&, const DrainRecord&) = default;
};

}  // namespace sheaf::coordinator
