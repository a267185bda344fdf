// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Stranger: a client that sends the coordinator anything that passes the checks of its transport:
// reports in the name of other workers, results without a lease, impossible jobs.
#pragma once

#include <cstdint>
#include <string>

#include "coordinator/service/farm/farm.h"
#include "tests/sim/network.h"
#include "tests/sim/world.h"

namespace sheaf::sim {

class Stranger {
 public:
  Stranger(World* world, Network* network)
      : world_(*world), network_(*network), random_(world->faults.random(Fault::kStranger)) {}

  // Sends one message.
  void Send();

 private:
  void SendReport(coordinator::Farm& farm);
  void SendResult(coordinator::Farm& farm);
  void SendJob(coordinator::Farm& farm);
  void SendRequest(coordinator::Farm& farm);
  uint64_t SomeLease(coordinator::Farm& farm);
  std::string SomeToken(uint64_t lease_id);
  std::string SomeWorker(coordinator::Farm& farm);
  std::string SomeFrameDigest(coordinator::Farm& farm);

  World& world_;
  Network& network_;
  Random& random_;
};

}  // namespace sheaf::sim
