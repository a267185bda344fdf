// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// FarmSize: the workers and threads of a farm.
#pragma once

#include <vector>

#include "absl/status/statusor.h"
#include "cli/job/farm_client.h"

namespace sheaf::cli {

// The largest number of jobs that a client asks for to judge a farm's load.
inline constexpr size_t kLoadJobsMax = 1000;

struct FarmSize {
  int worker_count = 0, thread_count = 0;  // Workers that take work, and their threads.
  int other_job_count = 0;                 // Jobs that are neither ended nor paused.
};

// Whether the worker takes work now.
bool TakesWork(const v1::Worker& worker);
FarmSize SizeOf(const std::vector<v1::Worker>& workers, const std::vector<v1::Job>& jobs);
// Errors: those of the calls.
absl::StatusOr<FarmSize> SizeOfFarm(FarmClient* client);

}  // namespace sheaf::cli
