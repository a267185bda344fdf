// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Agent: the worker's lease loop. One thread (Run) synchronizes, one uploads, and each of the
// others renders one lease at a time. What to do is decided by LeaseLedger and ResultOutbox under
// one lock; the threads only carry it out. Nothing here ends because the coordinator is away: what
// is leased is rendered, what is rendered is kept, and both are offered again until somebody
// answers.
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
  // Leases that wait while every thread has one: hides the way to the coordinator and back.
  int32_t leases_ahead = 2;
  uint64_t unsent_bytes_max = uint64_t{256} << 20;
  uint64_t scene_memory_bytes_max = uint64_t{4} << 30;
  // How long a stopping worker goes on with what it renders, and after that tries to reach the
  // coordinator for a last word.
  std::chrono::milliseconds grace{10'000};
  std::chrono::milliseconds farewell{3'000};
  // Ends after being without a lease for so long; zero never does.
  std::chrono::milliseconds exit_when_idle{0};
  // Waits between attempts to reach a coordinator that does not answer.
  std::chrono::milliseconds backoff_initial{100};
  std::chrono::milliseconds backoff_max{3'000};
  // Least time between two calls of Synchronize, so that short tasks share one.
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

  // Works until stop is requested and what is left is finished or handed back, or until it was idle
  // for long enough. Returns OK then; kUnavailable where stopping had to leave results behind
  // because the coordinator did not answer (their leases expire, and somebody else renders them
  // again). Call once.
  absl::Status Run(std::stop_token stop);

  AgentCounts counts() const;

 private:
  enum class Stage { kWorking, kFinishing, kReleasing, kDone };
  // The control thread. All require that mutex_ is held through lock.
  void Synchronize(std::unique_lock<std::mutex>* lock);
  void AdvanceStage(bool stop_requested);
  void WaitForNextSynchronize(std::unique_lock<std::mutex>* lock, std::stop_token stop);
  WorkerState MakeState(const LeaseLedger::Snapshot& snapshot) const;

  void RenderLoop(std::stop_token ended);
  void RenderOne(const LeaseLedger::Task& task);
  // Waits until the coordinator knows which scene this worker is about to load: if that ends the
  // worker, somebody must know what did. Not for long, and not where nobody answers.
  void TellLoading(const LeaseLedger::Task& task);
  void UploadLoop(std::stop_token ended);
  // Takes over the answer to one upload. Requires: mutex_ is held.
  void TakeOutcomes(const std::vector<const FinishedPart*>& parts,
                    const std::vector<UploadOutcome>& outcomes);
  // Has Synchronize called soon where too few leases wait, or where this worker stops. Requires:
  // mutex_ is held.
  void AskForMore();
  // Drops a part that the coordinator says is not what its key says. Requires: mutex_ is held.
  void Refuse(const FinishedPart& part, const absl::Status& status);
  // Requires: mutex_ is held.
  void Fail(uint64_t lease_id, FailureKind kind, const absl::Status& status);

  const AgentOptions options_;
  CoordinatorLink* const link_;
  const std::function<Clock::time_point()> now_;
  SceneCache scenes_;

  mutable std::mutex mutex_;
  std::condition_variable_any control_;  // Something to tell the coordinator, or a new stage.
  std::condition_variable_any work_;     // A lease to take, or room in the outbox.
  std::condition_variable_any uploads_;  // A part to send.
  LeaseLedger ledger_;
  ResultOutbox outbox_;
  AgentCounts counts_;
  Stage stage_ = Stage::kWorking;
  bool news_ = false;          // Since the last call of Synchronize was made.
  bool reachable_ = true;      // Whether the last call was answered.
  bool uploads_taken_ = true;  // Whether the last upload was.
  uint64_t answered_sequence_ = 0;        // Of the last snapshot that was answered.
  std::condition_variable_any answered_;  // A call was answered, or was not.
  Clock::time_point next_synchronize_, last_synchronize_, grace_end_, farewell_end_, idle_since_;
  std::chrono::milliseconds backoff_;
};

}  // namespace sheaf::worker
