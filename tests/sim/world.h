// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// World: what everybody in a simulation shares: the machine of the coordinator with its clocks and
// disk, the events to come, the faults, and the report of what went wrong.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <queue>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "tests/sim/faults.h"
#include "tests/sim/machine.h"
#include "tests/sim/random.h"

namespace sheaf::sim {

class World {
 public:
  // without: as Faults has it. traces: whether events are told, and to standard error.
  World(uint64_t seed, uint32_t without, bool traces)
      : machine(seed), random(Random(seed).Stream(2)), faults(seed, without), traces_(traces) {}

  Machine machine;
  Random random;  // For what is no fault.
  // Whether workers may deliver results with their state, in one call.
  bool offers_deliveries = false;
  Faults faults;
  // Digests of the bytes of parts with false pixels that look right.
  std::set<std::string> false_parts;
  // The identities that made each false result, by its task and the digest of its bytes.
  std::map<std::string, std::set<std::string>> false_results;
  // Digests of scenes that no worker can render.
  std::set<std::string> poisoned_scenes;

  // Each lease that was ever granted, and its task.
  std::map<uint64_t, std::string> granted;
  // The token that came with each lease.
  std::map<uint64_t, std::string> tokens;
  // When the coordinator last heard of each worker.
  std::map<std::string, absl::Duration> heard;

  absl::Duration now() const { return machine.steady(); }
  // Has `run` called after this much time.
  void After(absl::Duration delay, std::function<void()> run);
  // Lets time pass until the next event, and runs it. Returns false where there is none.
  bool RunNext();
  uint64_t step_count() const { return step_count_; }

  bool traces() const { return traces_; }
  // Writes one line of the trace; free of cost if it is off.
  template <typename... Parts>
  void Trace(const Parts&... parts) {
    if (traces_) Print(absl::StrCat(parts...));
  }
  // Something is wrong: the simulation ends. The first report counts.
  void Broken(const std::string& what);
  bool broken() const { return !broken_.empty(); }
  const std::string& WhatIsBroken() const { return broken_; }

 private:
  struct Event {
    absl::Duration time;
    uint64_t order = 0;
    std::function<void()> run;
    bool operator<(const Event& other) const {
      return time != other.time ? time > other.time : order > other.order;
    }
  };
  void Print(const std::string& line) const;

  const bool traces_;
  std::priority_queue<Event> events_;
  uint64_t event_count_ = 0;
  uint64_t step_count_ = 0;
  std::string broken_;
};

}  // namespace sheaf::sim
