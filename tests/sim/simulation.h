// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Simulation: a whole farm from a seed: coordinator, workers, users, strangers, network, disk and
// clocks, in one thread. Equal seeds give equal runs.
//
// For `steps` events the faults of the seed happen. Then they stop, machines come back, users
// resume their jobs, and every job must end within a bounded time.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "tests/sim/checks.h"
#include "tests/sim/coordinator_host.h"
#include "tests/sim/network.h"
#include "tests/sim/promises.h"
#include "tests/sim/sim_user.h"
#include "tests/sim/sim_worker.h"
#include "tests/sim/stranger.h"
#include "tests/sim/world.h"

namespace sheaf::sim {

struct SimulationOptions {
  uint64_t seed = 0;
  uint64_t steps = 600;
  uint32_t without = 0;  // A bit for each kind of Fault that is left out.
  bool trace = false;    // To standard error.
};

struct SimulationResult {
  std::string broken;  // Empty: all is right.
  uint64_t step_count = 0;
  uint64_t jobs_succeeded = 0, jobs_failed = 0, jobs_cancelled = 0;
  uint64_t lives = 0;
  uint64_t liars_found = 0, false_images = 0;  // Checks::false_image_count.
  std::array<uint64_t, kFaultCount> faults{};
};

class Simulation {
 public:
  explicit Simulation(const SimulationOptions& options);
  // Call once.
  SimulationResult Run();

 private:
  void AddWorker(bool may_lie);
  void StartWorker(const SimWorker::Habits& habits);
  void MeetWorkerFaults();
  void InterleaveCall(coordinator::Farm& farm);
  void StopFaults();
  bool HasEnded();
  void CheckFailures(SimulationResult* result);

  const SimulationOptions options_;
  World world_;
  Promises promises_;
  CoordinatorHost host_;
  Network network_;
  Checks checks_;
  Stranger stranger_;
  std::vector<std::shared_ptr<SimWorker>> workers_;
  std::vector<std::shared_ptr<SimUser>> users_;
  uint64_t worker_count_ = 0;
};

}  // namespace sheaf::sim
