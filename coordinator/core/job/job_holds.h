// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Plain values for work that users hold back: jobs that wait for other jobs, frames that wait for
// approval, and drained workers (docs/scheduling.md).
#pragma once

#include <cstdint>
#include <string>

#include "absl/time/time.h"

namespace sheaf::coordinator {

// A job waits for another one.
struct JobDependency {
  uint64_t job_id = 0;    // The awaited job; smaller than the waiting job's id.
  bool by_frame = false;  // Frame n waits for its frame n; otherwise job for job.
  bool released = false;  // A user started the waiting job anyway.
  bool removed = false;   // The awaited job was delivered and then removed.
  friend bool operator==(const JobDependency&, const JobDependency&) = default;
};

// A frame that first gets part of its samples, and the rest once a user approves the image.
struct FrameApproval {
  uint64_t samples = 0;   // Per pixel, after approval.
  bool approved = false;  // The frame's settings then have `samples`.
  friend bool operator==(const FrameApproval&, const FrameApproval&) = default;
};

// A worker that gets no work because an operator drained it.
struct DrainRecord {
  std::string worker_id;
  bool then_exit = false;  // It is told to exit once it holds no lease.
  absl::Time time = absl::InfinitePast();
  friend bool operator==(const DrainRecord&, const DrainRecord&) = default;
};

}  // namespace sheaf::coordinator
