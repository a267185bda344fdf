// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// SimWorker: a worker. Its leases and its results are kept by the real LeaseLedger and
// ResultOutbox; it drives them as Agent does with its threads, by events. It may be slow, frozen or
// killed, and may lie.
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
#include "worker/agent/lease_ledger.h"
#include "worker/agent/result_outbox.h"

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
  SimWorker(World* world, Network* network, const Promises* promises, std::string id,
            const Habits& habits);

  void Start() { ScheduleSynchronize(absl::ZeroDuration()); }
  const std::string& id() const { return id_; }
  bool IsAlive() const { return alive_; }
  const Habits& habits() const { return habits_; }
  // The identity that answers for it.
  const std::string& identity() const { return habits_.identity.empty() ? id_ : habits_.identity; }
  // It does nothing more, and what it has is lost.
  void Kill() { alive_ = false; }
  // Nothing happens in it for so long; then it goes on as if no time had passed.
  void Freeze(absl::Duration time);
  // It finishes what it renders and gives the rest back; then it ends.
  void Drain();

 private:
  // Has `run` called after that much of the worker's own time, if it is alive then.
  void After(absl::Duration delay, std::function<void()> run);
  // The same at once: something has reached the worker.
  void Wake(std::function<void()> run);

  void ScheduleSynchronize(absl::Duration delay);
  void Synchronize();
  coordinator::WorkerReport MakeReport(const worker::LeaseLedger::Snapshot& snapshot) const;
  // A lease means one task for ever.
  void CheckGrant(const worker::Lease& lease);
  void TakeAnswer(uint64_t sequence, const std::vector<worker::Lease>& leases,
                  absl::Duration next_synchronize);
  void NoteNews();
  void EndIfDone();

  void TakeWork();
  void Hoard();
  void Load(const worker::LeaseLedger::Task& task);
  // Reads the guiding field of the task's frame, once a frame, and goes on.
  void FetchField(const worker::LeaseLedger::Task& task);
  void BeginRendering(const worker::LeaseLedger::Task& task);
  void Render(const worker::LeaseLedger::Task& task);
  void FailTask(uint64_t lease_id, worker::FailureKind kind);
  worker::FinishedPart MakePart(const worker::Lease& lease);
  void Lie(worker::FinishedPart* part);
  // The worker will deliver this part, which is not the true one of its task.
  void NoteFalse(const worker::FinishedPart& part);

  void Upload();
  // At the coordinator: takes parts one after the other, until one is refused.
  absl::StatusOr<std::vector<coordinator::ResultOutcome>> AddResults(
      coordinator::Farm& farm, const std::vector<worker::FinishedPart>& parts);
  // The part as it renders it when its pixels come out false.
  std::string MakeFalseBytes(const worker::Lease& lease) const;
  // was_liar: before the call it was durable that the worker makes false results.
  void CheckOutcome(const worker::FinishedPart& part, bool was_liar,
                    coordinator::ResultOutcome outcome);
  void TakeOutcomes(const absl::StatusOr<std::vector<coordinator::ResultOutcome>>& outcomes,
                    size_t part_count);
  void RetryUpload();

  World& world_;
  Network& network_;
  const Promises& promises_;
  const std::string id_;
  const Habits habits_;
  bool alive_ = true;
  bool draining_ = false;
  absl::Duration frozen_until_;

  worker::LeaseLedger ledger_;
  worker::ResultOutbox outbox_;
  std::set<std::string> warm_scenes_;
  std::set<std::string> fields_;  // Digests of those that it has.
  int32_t busy_threads_ = 0;
  uint64_t timer_ = 0;  // Of the next Synchronize: later ones replace it.
  bool synchronizing_ = false;
  bool news_ = false;
  absl::Duration backoff_, upload_backoff_;
  bool uploading_ = false;
  size_t upload_parts_max_;
};

}  // namespace sheaf::sim
