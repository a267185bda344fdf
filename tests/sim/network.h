// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Network: calls to the coordinator, as gRPC carries them, with the faults of networks: requests
// and replies are lost, late, doubled and out of order; a call that is not answered fails at its
// deadline.
#pragma once

#include <functional>
#include <memory>

#include "coordinator/service/farm/farm.h"
#include "tests/sim/coordinator_host.h"
#include "tests/sim/world.h"

namespace sheaf::sim {

class Network {
 public:
  Network(World* world, CoordinatorHost* host) : world_(*world), host_(*host) {}

  // The reply as it reaches the caller.
  using Reply = std::function<void()>;
  using Serve = std::function<Reply(coordinator::Farm& farm)>;

  // serve: what the coordinator does; it returns the reply. Either the reply is called once, or
  // `failed`.
  void Call(const char* what, Serve serve, std::function<void()> failed);

 private:
  absl::Duration Latency();
  // time_left: until the deadline.
  void Arrive(const char* what, const Serve& serve, const std::shared_ptr<bool>& ended,
              const std::function<void()>& failed, absl::Duration time_left);

  World& world_;
  CoordinatorHost& host_;
};

}  // namespace sheaf::sim
