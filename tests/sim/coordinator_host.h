// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// CoordinatorHost: the coordinator's process. It starts the real farm on the simulated machine,
// stops it in order or in the middle of any change of the disk, and starts it again.
//
// With a single thread, a process cannot be killed inside a call. Instead the disk refuses all
// changes from that point on, and whatever the call returns reaches no caller.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "coordinator/service/farm/farm.h"
#include "tests/sim/promises.h"
#include "tests/sim/promising_store.h"
#include "tests/sim/world.h"

namespace sheaf::sim {

class CoordinatorHost {
 public:
  using Call = std::function<void(coordinator::Farm& farm)>;

  CoordinatorHost(World* world, Promises* promises);
  ~CoordinatorHost();

  // Starts it, and has it do its own work from then on.
  void Start();
  bool IsUp() const { return farm_ != nullptr; }
  coordinator::Farm* farm() { return farm_.get(); }
  // Runs a call at the coordinator. Returns false where it is down, or ended during the call: then
  // its outcome is unknown to the world.
  bool Serve(const char* what, const Call& call);
  // Called after each call that was served, with no other call under way.
  void set_after_call(Call after_call) { after_call_ = std::move(after_call); }
  // Run while a result is between its file and its row, as another thread could.
  void set_interleaved(Call interleaved) { interleaved_ = std::move(interleaved); }
  uint64_t life() const { return life_; }
  const coordinator::FarmOptions& options() const { return options_; }

 private:
  int Gate(SimDisk::Operation operation, const std::string& path, bool grows);
  absl::StatusOr<std::unique_ptr<coordinator::Farm>> Open();
  void Work();
  void PlanEnd();
  void NoteEnd();
  void MeetFaults();
  void FillDisk();
  void DamageFile();

  World& world_;
  Promises& promises_;
  coordinator::FarmOptions options_;
  std::unique_ptr<coordinator::Farm> farm_;
  Call after_call_, interleaved_;
  uint64_t life_ = 0;
  uint64_t refused_count_ = 0;   // Changes of the disk that a fault refused.
  uint64_t changes_to_end_ = 0;  // The process ends with that many changes; 0: it does not.
  bool loses_power_ = false;
  bool disk_full_ = false;
  bool is_interleaving_ = false;
};

}  // namespace sheaf::sim
