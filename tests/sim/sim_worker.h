// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SimWorker: a worker. It drives the real AgentState by events, as Agent does with its threads, and
// checks what the state must keep: no task begins on a worker that is away or stops, a task that
// outlasts the grace period is told to stop, and a worker that is told to stop ends in time and
// loses nothing before the grace period is over. It may be slow, frozen, away or killed, and may
// lie.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "coordinator/service/farm/farm.h"
#include "tests/sim/network.h"
#include "tests/sim/promises.h"
#include "tests/sim/world.h"
#include "worker/agent/agent_state.h"

namespace sheaf::sim {

class SimWorker : public std::enable_shared_from_this<SimWorker> {
 public:
  struct Habits {
    int32_t thread_count = 1;
    double slowness = 1;
    bool lies = false;
    bool makes_false_pixels = false;  // As a broken processor does, now and then.
    bool hoards = false;              // Says that it renders its leases, and never ends one.
    std::string identity = {};        // As WorkerReport has it.
  };
  SimWorker(World* world, Network* network, Promises* promises, std::string id,
            const Habits& habits);

  void Start() { ScheduleTurn(absl::ZeroDuration()); }
  const std::string& id() const { return id_; }
  bool IsAlive() const { return alive_; }
  const Habits& habits() const { return habits_; }
  // The identity that answers for it.
  const std::string& identity() const { return habits_.identity.empty() ? id_ : habits_.identity; }
  // It stops at once and loses all that it has.
  void Kill() { alive_ = false; }
  // It stands still for this time, then continues as if none had passed.
  void Freeze(absl::Duration time);
  // Its machine's owner needs the machine for this time, in which it takes no work.
  void GoAway(absl::Duration time);
  void ComeBack();
  // It finishes what it renders and gives the rest back; then it ends.
  void Drain();

 private:
  // Has `run` called after that much of the worker's own time, if it is alive then.
  void After(absl::Duration delay, std::function<void()> run);
  // The same at once: something has reached the worker.
  void Wake(std::function<void()> run);

  worker::AgentState::Time Now() const;
  // Has Turn called after that delay, and not when it was scheduled before.
  void ScheduleTurn(absl::Duration delay);
  // One turn of the control loop.
  void Turn();
  // After a change: does what the state has become ready for.
  void Continue();
  void Synchronize();
  // At the coordinator: the answer to a report.
  absl::StatusOr<worker::DesiredState> Ask(coordinator::Farm& farm,
                                           const coordinator::WorkerReport& report);
  coordinator::WorkerReport MakeReport(const worker::WorkerState& state) const;
  // A lease stands for one task forever.
  void CheckGrant(const worker::Lease& lease);
  void TakeAnswer(uint64_t sequence, const absl::StatusOr<worker::DesiredState>& desired);
  void CheckEnd();
  // It ends within its grace and farewell.
  void ExpectEnd();
  // Whether the worker has long been told to stop or to take no work, so that no task may run.
  bool IsGraceOver() const;

  void TakeWork();
  void Hoard();
  void Load(const worker::LeaseLedger::Task& task);
  // Reads the guiding field of the task's frame, once a frame, and continues.
  void FetchField(const worker::LeaseLedger::Task& task);
  void BeginRendering(const worker::LeaseLedger::Task& task);
  void Render(const worker::LeaseLedger::Task& task);
  void FailTask(uint64_t lease_id, worker::FailureKind kind);
  // Ends a task that was told to stop. Returns whether it was.
  bool EndIfStopped(const worker::LeaseLedger::Task& task);
  worker::FinishedPart MakePart(const worker::Lease& lease);
  void Lie(worker::FinishedPart* part);
  // The worker will deliver this part, which is not the true one of its task.
  void NoteFalse(const worker::FinishedPart& part);

  void Upload();
  // Sends results with the report of its state, in one call.
  void Deliver();
  void TakeDelivery(uint64_t sequence, const absl::StatusOr<worker::Delivery>& delivery);
  // At the coordinator: takes the parts together, or the first ones of a call that is cut.
  absl::StatusOr<std::vector<coordinator::ResultOutcome>> AddResults(
      coordinator::Farm& farm, const std::vector<worker::FinishedPart>& parts);
  // The part as it renders it when its pixels come out false.
  std::string MakeFalseBytes(const worker::Lease& lease) const;
  // was_liar: before the call it was durable that the worker makes false results.
  void CheckOutcome(const worker::FinishedPart& part, bool was_liar,
                    coordinator::ResultOutcome outcome);
  void TakeOutcomes(const absl::StatusOr<std::vector<coordinator::ResultOutcome>>& outcomes);

  World& world_;
  Network& network_;
  Promises& promises_;
  const std::string id_;
  const Habits habits_;
  bool alive_ = true;
  absl::Duration frozen_until_;
  absl::Duration awake_at_;  // When the events that it froze happen, at the latest.

  worker::AgentState state_;
  bool stop_requested_ = false;
  absl::Duration stopped_at_;                            // When it was told to stop.
  absl::Duration leaves_at_ = absl::InfiniteDuration();  // When it was told to stop or went away.
  uint64_t absence_ = 0;                                 // Counts GoAway: a later one replaces it.
  std::set<std::string> warm_scenes_;
  std::set<std::string> fields_;  // Digests of those that it has.
  int32_t busy_threads_ = 0;
  uint64_t timer_ = 0;  // The next turn's: a later one replaces it.
  bool synchronizing_ = false;
  bool uploading_ = false;
};

}  // namespace sheaf::sim
