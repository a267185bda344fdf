// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// JobEvent: something that happened to a job, for users who want to know why it is as it is. The
// acts of users are verbs, "cancel"; those of the farm are participles, "delivered". Nothing is
// decided by events: a lost one changes no job.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>

#include "absl/time/time.h"

namespace sheaf::coordinator {

// Kept of a job; older ones are removed.
inline constexpr int64_t kJobEventsMax = 1000;

struct JobEvent {
  uint64_t job_id = 0;
  absl::Time time = {};
  std::string what = {};                     // As in v1::JobEvent.
  std::string who = {};                      // A user, or "workers/ID"; empty: the coordinator.
  std::optional<int32_t> frame_number = {};  // None: the whole job.
  std::string text = {};
  friend bool operator==(const JobEvent&, const JobEvent&) = default;
};

}  // namespace sheaf::coordinator
