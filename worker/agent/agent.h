// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Agent: the worker's lease loop. One thread (Run) synchronizes, one uploads, and each of the
// others renders one lease at a time. LeaseLedger and ResultOutbox make all decisions under one
// lock; the threads only execute them. The loop survives an absent coordinator: leased tasks are
// rendered, results are kept, and both are reported again until the coordinator answers.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "common/base/mutex.h"
#include "worker/agent/coordinator_link.h"
#include "worker/agent/lease_ledger.h"
#include "worker/agent/result_outbox.h"
#include "worker/agent/scene_cache.h"
#include "worker/agent/scene_loader.h"

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
  // Returns why this worker shall take no work now, for people; empty: it may. Called by Run, about
  // once per away_interval, with the memory of the loaded scenes. Where it names a reason, running
  // tasks continue for the grace period, then all leases are returned and all scenes freed; where
  // it names none any more, the worker goes on. Null: never a reason.
  std::function<std::string(uint64_t scene_bytes)> why_away;
  std::chrono::milliseconds away_interval{1'000};
};

// Counts for the log and for tests.
struct AgentCounts {
  uint64_t accepted = 0, duplicate_equal = 0, duplicate_mismatch = 0, superseded = 0;
  uint64_t failed = 0;
};

class Agent {
 public:
  using Clock = std::chrono::steady_clock;

  // Requires: link and loader outlive this.
  Agent(AgentOptions options, CoordinatorLink* link, SceneLoader* loader,
        std::function<Clock::time_point()> now = Clock::now);

  // Works until stop is requested and all leases are finished or returned, or until the agent was
  // idle for long enough. Returns OK then; kUnavailable if it stopped with undelivered results
  // because the coordinator did not answer (their leases expire, and another worker renders them
  // again). Call once.
  absl::Status Run(std::stop_token stop);

  AgentCounts counts() const;
  // How long ago Run took its last turn, or this was made. It takes one for each call of
  // Synchronize, and waits for the coordinator for as long as the link does.
  Clock::duration SinceLastTurn() const;

 private:
  // kAway: it takes no work for a while.
  enum class Stage { kWorking, kAway, kFinishing, kReleasing, kDone };
  // The control thread. Releases the mutex while it waits for the coordinator.
  void Synchronize() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void AdvanceStage(bool stop_requested) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Asks why_away when it is time, and frees the scenes of a worker that is away. Releases the
  // mutex meanwhile.
  void LookAround() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Goes away, gives back what it holds, and comes back.
  void AdvanceAway(Clock::time_point now) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void WaitForNextSynchronize(std::stop_token stop) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Answered calls follow news closely; unanswered ones wait for their backoff.
  bool HasNews() const ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return news_ && reachable_; }
  WorkerState MakeState(const LeaseLedger::Snapshot& snapshot) const
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  void RenderLoop(std::stop_token ended);
  void RenderOne(const LeaseLedger::Task& task);
  // Waits until the coordinator knows which scene this worker is about to load, so that the scene
  // is known if loading it kills the worker. The wait is short, and is skipped if the coordinator
  // does not answer.
  void ReportLoading(const LeaseLedger::Task& task);
  void UploadLoop(std::stop_token ended);
  // Takes over the answer to one upload.
  void TakeOutcomes(const std::vector<const FinishedPart*>& parts,
                    const std::vector<UploadOutcome>& outcomes)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Has Synchronize called soon where too few leases wait, or where this worker stops.
  void RequestLeases() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Drops a part that the coordinator says is not what its key says.
  void Refuse(const FinishedPart& part, const absl::Status& status)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void Fail(uint64_t lease_id, FailureKind kind, const absl::Status& status)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  const AgentOptions options_;
  CoordinatorLink* const link_;
  const std::function<Clock::time_point()> now_;
  SceneCache scenes_;

  mutable Mutex mutex_;
  CondVar control_;   // Something to tell the coordinator, or a new stage.
  CondVar work_;      // A lease to take, or room in the outbox.
  CondVar uploads_;   // A part to send.
  CondVar answered_;  // A call was answered, or was not.
  LeaseLedger ledger_ ABSL_GUARDED_BY(mutex_);
  ResultOutbox outbox_ ABSL_GUARDED_BY(mutex_);
  AgentCounts counts_ ABSL_GUARDED_BY(mutex_);
  Stage stage_ ABSL_GUARDED_BY(mutex_) = Stage::kWorking;
  bool told_to_exit_ ABSL_GUARDED_BY(mutex_) = false;
  std::string away_reason_ ABSL_GUARDED_BY(mutex_);
  // News since the last call of Synchronize was made.
  bool news_ ABSL_GUARDED_BY(mutex_) = false;
  bool reachable_ ABSL_GUARDED_BY(mutex_) = true;      // Whether the last call was answered.
  bool refused_ ABSL_GUARDED_BY(mutex_) = false;       // Whether its version was refused then.
  bool uploads_taken_ ABSL_GUARDED_BY(mutex_) = true;  // Whether the last upload was.
  // The sequence of the last answered snapshot.
  uint64_t answered_sequence_ ABSL_GUARDED_BY(mutex_) = 0;
  Clock::time_point next_synchronize_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point next_look_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point last_turn_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point last_synchronize_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point grace_end_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point farewell_end_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point idle_since_ ABSL_GUARDED_BY(mutex_);
  std::chrono::milliseconds backoff_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::worker
