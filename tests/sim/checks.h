// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Checks: what must hold whenever no call is under way at the coordinator.
//
//     leases      each belongs to a live job and to a worker that may hold it; none is held twice
//                 by one worker; each sample of an open frame is done, leased or ready to lease
//     workers     one is lost exactly where it was silent for longer than the lease duration
//     jobs        what is delivered and what has ended agrees with the phases of frames and jobs
//     promises    the phases, pauses and priorities are those that were promised
//     verdicts    an identity said to make false results made one, or was outvoted by two that did
//     limits      tables are within their limits
//     counters    results and samples are as many as were acknowledged
//
// and at the end of a simulation: every job has ended, nothing is left of leases nor of those who
// were found to make false results, and images are those of one process, except where a false part
// was not found in time (Promises::MayBeFalse).
#pragma once

#include <cstdint>
#include <set>
#include <string>

#include "coordinator/service/farm/farm.h"
#include "tests/sim/promises.h"
#include "tests/sim/world.h"

namespace sheaf::sim {

class Checks {
 public:
  Checks(World* world, const Promises* promises) : world_(*world), promises_(*promises) {}

  // After each call.
  void Check(coordinator::Farm& farm, const coordinator::FarmOptions& options);
  // At the end. Returns false where an image is damaged and being made again: ask later.
  bool CheckEnd(coordinator::Farm& farm);
  // Images with a false part that was not found, or was found when it could no longer be corrected.
  uint64_t false_image_count() const { return false_image_count_; }

 private:
  void CheckLeases(const coordinator::Scheduler& scheduler);
  void CheckHolderOfCheck(const coordinator::Scheduler& scheduler, const coordinator::Lease& lease);
  void CheckFrame(const coordinator::Scheduler& scheduler, const coordinator::FrameId& id,
                  const coordinator::FrameRecord& frame, uint64_t leased);
  void CheckJobs(coordinator::Farm& farm);
  void CheckWorkers(const coordinator::Scheduler& scheduler, const coordinator::Limits& limits);
  void CheckVerdicts();
  void CheckLimits(coordinator::Farm& farm, const coordinator::FarmOptions& options);
  bool CheckImages(coordinator::Farm& farm, uint64_t job_id);

  World& world_;
  const Promises& promises_;
  // Tasks that failed more often than a job survives, by those who had not delivered a result.
  std::set<coordinator::TaskId> of_strangers_;
  std::set<uint64_t> known_checks_;  // Leases of checks, over all runs of the coordinator.
  uint64_t false_image_count_ = 0;
};

}  // namespace sheaf::sim
