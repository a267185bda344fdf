// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Agent: the worker's lease loop. One thread (Run) synchronizes, one uploads, and each of the
// others renders one lease at a time. LeaseLedger and ResultOutbox make all decisions under one
// lock; the threads only execute them. The loop survives an absent coordinator: leased tasks are
// rendered, results are kept, and both are reported again until the coordinator answers.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <stop_token>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "worker/agent/coordinator_link.h"
#include "worker/agent/lease_ledger.h"
#include "worker/agent/result_outbox.h"
#include "worker/agent/scene_cache.h"
#include "worker/agent/scene_loader.h"

namespace sheaf::worker {

struct AgentOptions {
  std::string worker_id, host, numeric_profile;
  int32_t thread_count = 1;
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
  // Minimum time between two calls of Synchronize, so that short tasks share one.
  std::chrono::milliseconds synchronize_spacing{5};
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

 private:
  enum class Stage { kWorking, kFinishing, kReleasing, kDone };
  // The control thread. All require: lock holds mutex_.
  void Synchronize(std::unique_lock<std::mutex>* lock);
  void AdvanceStage(bool stop_requested);
  void WaitForNextSynchronize(std::unique_lock<std::mutex>* lock, std::stop_token stop);
  WorkerState MakeState(const LeaseLedger::Snapshot& snapshot) const;

  void RenderLoop(std::stop_token ended);
  void RenderOne(const LeaseLedger::Task& task);
  // Waits until the coordinator knows which scene this worker is about to load, so that the scene
  // is known if loading it kills the worker. The wait is short, and is skipped if the coordinator
  // does not answer.
  void TellLoading(const LeaseLedger::Task& task);
  void UploadLoop(std::stop_token ended);
  // Processes the reply to one upload. Requires: mutex_ is held.
  void TakeOutcomes(const std::vector<const FinishedPart*>& parts,
                    const std::vector<UploadOutcome>& outcomes);
  // Makes Synchronize run soon if too few leases wait or this worker is stopping. Requires: mutex_
  // is held.
  void AskForMore();
  // Drops a part that the coordinator rejects because it does not match its key. Requires: mutex_
  // is held.
  void Refuse(const FinishedPart& part, const absl::Status& status);
  // Requires: mutex_ is held.
  void Fail(uint64_t lease_id, FailureKind kind, const absl::Status& status);

  const AgentOptions options_;
  CoordinatorLink* const link_;
  const std::function<Clock::time_point()> now_;
  SceneCache scenes_;

  mutable std::mutex mutex_;
  std::condition_variable_any control_;  // There is news for the coordinator, or a new stage.
  std::condition_variable_any work_;     // A lease is available, or there is room in the outbox.
  std::condition_variable_any uploads_;  // A part is ready to send.
  LeaseLedger ledger_;
  ResultOutbox outbox_;
  AgentCounts counts_;
  Stage stage_ = Stage::kWorking;
  bool news_ = false;          // Since the last call of Synchronize began.
  bool reachable_ = true;      // Whether the last call was answered.
  bool uploads_taken_ = true;  // Whether the last upload was accepted.
  uint64_t answered_sequence_ = 0;        // The sequence of the last answered snapshot.
  std::condition_variable_any answered_;  // A call was answered, or failed.
  Clock::time_point next_synchronize_, last_synchronize_, grace_end_, farewell_end_, idle_since_;
  std::chrono::milliseconds backoff_;
};

}  // namespace sheaf::worker
