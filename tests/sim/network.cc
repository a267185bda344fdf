// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "tests/sim/network.h"

#include <algorithm>
#include <utility>

namespace sheaf::sim {
namespace {

constexpr absl::Duration kLatencyMin = absl::Microseconds(200);
constexpr absl::Duration kLatencyMax = absl::Milliseconds(30);
constexpr absl::Duration kLateMax = absl::Minutes(1);
constexpr absl::Duration kDeadline = absl::Seconds(10);

}  // namespace

absl::Duration Network::Latency() {
  absl::Duration latency = world_.random.Between(kLatencyMin, kLatencyMax);
  if (world_.faults.Happens(Fault::kLate)) {
    latency += world_.faults.random(Fault::kLate).Between(kLatencyMin, kLateMax);
  }
  return latency;
}

void Network::Call(const char* what, Serve serve, std::function<void()> failed) {
  const auto ended = std::make_shared<bool>(false);
  const auto fail_once = [ended, failed = std::move(failed)] {
    if (!std::exchange(*ended, true)) failed();
  };
  if (world_.faults.Happens(Fault::kRequestLost)) {
    world_.Trace("lost: request ", what);
    world_.After(kDeadline, fail_once);
    return;
  }
  const int copies = world_.faults.Happens(Fault::kDoubled) ? 2 : 1;
  for (int i = 0; i < copies; ++i) {
    const absl::Duration latency = Latency();
    if (latency > kDeadline) world_.After(kDeadline, fail_once);
    world_.After(latency, [this, what, serve, ended, fail_once, latency] {
      Arrive(what, serve, ended, fail_once, std::max(kDeadline - latency, absl::ZeroDuration()));
    });
  }
}

void Network::Arrive(const char* what, const Serve& serve, const std::shared_ptr<bool>& ended,
                     const std::function<void()>& failed, absl::Duration time_left) {
  Reply reply;
  const bool served = host_.Serve(what, [&](coordinator::Farm& farm) { reply = serve(farm); });
  if (!served) {
    world_.After(std::min(Latency(), time_left), failed);  // Its connection is closed.
    return;
  }
  const absl::Duration latency = Latency();
  const bool lost = world_.faults.Happens(Fault::kReplyLost);
  if (lost || latency > time_left) world_.After(time_left, failed);
  if (lost) {
    world_.Trace("lost: reply to ", what);
    return;
  }
  world_.After(latency, [ended, reply = std::move(reply)] {
    if (!std::exchange(*ended, true)) reply();
  });
}

}  // namespace sheaf::sim
