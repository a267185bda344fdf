// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// AgentOptions: who a worker is, and the limits and times of its lease loop.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace sheaf::worker {

struct AgentOptions {
  std::string worker_id, host, numeric_profile;
  std::string pool;  // Empty: the default one.
  std::vector<std::string> tags;
  uint64_t memory_bytes = 0;  // For scenes, as the coordinator is told; 0: not known.
  int32_t thread_count = 1;
  // Whether failures of leases are logged as warnings; the coordinator is told in any case.
  bool warns_of_failed_leases = true;
  // Leases that wait while every thread has one: hides the round trip to the coordinator.
  int32_t leases_ahead = 2;
  uint64_t unsent_bytes_max = uint64_t{256} << 20;
  uint64_t scene_memory_bytes_max = uint64_t{4} << 30;
  // How long a stopping worker continues its rendering, and how long it then tries to reach the
  // coordinator for a final report.
  std::chrono::milliseconds grace{10'000};
  std::chrono::milliseconds farewell{3'000};
  // Ends after this time without a lease; zero: never.
  std::chrono::milliseconds exit_when_idle{0};
  // Waits between attempts to reach a coordinator that does not answer.
  std::chrono::milliseconds backoff_initial{100};
  std::chrono::milliseconds backoff_max{3'000};
  // Wait between attempts where the coordinator refuses this worker's version of the protocol,
  // until one of the two is replaced.
  std::chrono::milliseconds refused_backoff{30'000};
  // Minimum time between two calls of Synchronize, so that short tasks share one.
  std::chrono::milliseconds synchronize_spacing{5};
  // Returns the reason to take no work, for people, or "" if there is none. Called by Agent::Run,
  // about once per away_interval, with the memory of the loaded scenes. While there is a reason,
  // running tasks continue for the grace period, then all leases are returned and all scenes freed.
  // Null: there never is one.
  std::function<std::string(uint64_t scene_bytes)> why_away;
  std::chrono::milliseconds away_interval{1'000};
};

}  // namespace sheaf::worker
