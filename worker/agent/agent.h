// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// Agent: runs an AgentState with threads. One (Run) synchronizes, one uploads, and each of the
// others renders one lease at a time; all ask the state under one lock. The loop survives an absent
// coordinator: leased tasks are rendered, results are kept, and both are reported again until the
// coordinator answers.
#pragma once

#include <functional>
#include <stop_token>

#include "absl/status/status.h"
#include "common/base/mutex.h"
#include "worker/agent/agent_options.h"
#include "worker/agent/agent_state.h"
#include "worker/agent/coordinator_link.h"
#include "worker/agent/scene_cache.h"
#include "worker/agent/scene_loader.h"

namespace sheaf::worker {

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
  // Both are of the control thread, and release the mutex while they call what may take long.
  void Synchronize() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  // Asks why_away when it is time, and frees the scenes of a worker that is away.
  void LookAround() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void WaitForNextTurn(std::stop_token stop) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);

  void RenderLoop(std::stop_token ended);
  void RenderOne(const LeaseLedger::Task& task);
  // Waits until the coordinator knows which scene this worker is about to load, so that the scene
  // is known if loading it kills the worker. The wait is short, and is skipped if the coordinator
  // does not answer.
  void ReportLoading(const LeaseLedger::Task& task);
  void Fail(uint64_t lease_id, FailureKind kind, const absl::Status& status)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void UploadLoop(std::stop_token ended);
  // Send what AgentState::NextUpload has, and release the mutex meanwhile. Return how long to wait
  // before the next upload.
  Clock::duration Upload() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  Clock::duration Deliver() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_);
  void AddScenes(WorkerState* state);

  const AgentOptions options_;
  CoordinatorLink* const link_;
  const std::function<Clock::time_point()> now_;
  SceneCache scenes_;

  mutable Mutex mutex_;
  CondVar control_;   // NextTurn may have come forward.
  CondVar work_;      // A lease to take, or room in the outbox.
  CondVar uploads_;   // A part to send.
  CondVar answered_;  // A call was answered, or was not.
  AgentState state_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point next_look_ ABSL_GUARDED_BY(mutex_);
  Clock::time_point last_turn_ ABSL_GUARDED_BY(mutex_);
};

}  // namespace sheaf::worker
