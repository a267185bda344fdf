// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// For tests of the agent: a coordinator and a renderer that do as they are told, and an agent in a
// thread beside the test.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <map>
#include <memory>
#include <new>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "common/base/mutex.h"
#include "worker/agent/agent.h"

namespace sheaf::worker {

using std::chrono::milliseconds;

// A coordinator of one worker: offers each task until it has a result, with configurable failures.
class FakeCoordinator : public CoordinatorLink {
 public:
  explicit FakeCoordinator(uint64_t task_count) {
    for (uint64_t task = 0; task < task_count; ++task) open_.insert(task);
  }

  absl::StatusOr<DesiredState> Synchronize(const WorkerState& state) override {
    const MutexLock lock(&mutex_);
    ++synchronize_count_;
    return Answer(state);
  }

  absl::StatusOr<Delivery> Deliver(const WorkerState& state,
                                   const std::vector<const FinishedPart*>& parts) override {
    const MutexLock lock(&mutex_);
    ++delivery_count_;
    absl::StatusOr<std::vector<UploadOutcome>> outcomes = Take(parts);
    if (!outcomes.ok()) return outcomes.status();
    absl::StatusOr<DesiredState> desired = Answer(state);
    if (!desired.ok()) return desired.status();
    return Delivery{*std::move(outcomes), *std::move(desired)};
  }

  absl::StatusOr<std::vector<UploadOutcome>> UploadResults(
      const std::string&, const std::vector<const FinishedPart*>& parts) override {
    const MutexLock lock(&mutex_);
    return Take(parts);
  }

  void Abort() override {}

  void set_away(bool away) {
    const MutexLock lock(&mutex_);
    away_ = away;
  }
  void set_is_of_another_version(bool is) {
    const MutexLock lock(&mutex_);
    is_of_another_version_ = is;
  }
  void LoseEveryReply(int every) {
    const MutexLock lock(&mutex_);
    lose_every_reply_ = every;
  }
  void Refuse(uint64_t task) {
    const MutexLock lock(&mutex_);
    refused_.insert(task);
  }
  // As after a restart without a table of leases: everything without a result is open.
  void ForgetLeases() {
    const MutexLock lock(&mutex_);
    for (const auto& [id, task] : leased_) open_.insert(task);
    leased_.clear();
  }
  void CancelEverything() {
    const MutexLock lock(&mutex_);
    open_.clear();
    leased_.clear();
  }
  // As a coordinator does whose operator drains the worker.
  void TellToExit() {
    const MutexLock lock(&mutex_);
    open_.clear();
    tells_to_exit_ = true;
  }
  size_t done_count() const {
    const MutexLock lock(&mutex_);
    return done_.size();
  }
  std::vector<LeaseFailure> failures() const {
    const MutexLock lock(&mutex_);
    return failures_;
  }
  bool last_was_loading() const {
    const MutexLock lock(&mutex_);
    return !last_.leases.empty() && last_.leases[0].phase == LeasePhase::kLoading;
  }
  bool last_was_draining_and_empty() const {
    const MutexLock lock(&mutex_);
    return last_.draining && last_.leases.empty();
  }
  void OfferDeliveries() {
    const MutexLock lock(&mutex_);
    offers_deliveries_ = true;
  }
  int delivery_count() const {
    const MutexLock lock(&mutex_);
    return delivery_count_;
  }
  int synchronize_count() const {
    const MutexLock lock(&mutex_);
    return synchronize_count_;
  }

 private:
  absl::StatusOr<DesiredState> Answer(const WorkerState& state)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (away_) return absl::UnavailableError("connection refused");
    if (is_of_another_version_) return absl::FailedPreconditionError("this program is older");
    Report(state);
    DesiredState desired;
    desired.next_synchronize = milliseconds(20);
    desired.deliveries = offers_deliveries_;
    desired.exit = tells_to_exit_ && leased_.empty();
    for (const auto& [id, task] : leased_) desired.leases.push_back(MakeLease(id, task));
    if (lose_every_reply_ > 0 && ++answer_count_ % lose_every_reply_ == 0) {
      return absl::DeadlineExceededError("reply lost");
    }
    return desired;
  }

  absl::StatusOr<std::vector<UploadOutcome>> Take(const std::vector<const FinishedPart*>& parts)
      ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    if (away_) return absl::UnavailableError("connection refused");
    std::vector<UploadOutcome> outcomes;
    for (const FinishedPart* part : parts) {
      if (refused_.contains(part->block.first)) return absl::InvalidArgumentError("not a part");
    }
    for (const FinishedPart* part : parts) {
      const uint64_t task = part->block.first;
      std::erase_if(leased_, [&](const auto& entry) { return entry.second == task; });
      open_.erase(task);
      outcomes.push_back(done_.insert(task).second ? UploadOutcome::kAccepted
                                                   : UploadOutcome::kDuplicateEqual);
    }
    ++upload_count_;
    if (lose_every_reply_ > 0 && upload_count_ % lose_every_reply_ == 0) {
      return absl::UnavailableError("reply lost");
    }
    return outcomes;
  }

  void Report(const WorkerState& state) ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    last_ = state;
    for (const LeaseFailure& failure : state.failures) {
      const auto it = leased_.find(failure.lease_id);
      if (it == leased_.end()) continue;
      failures_.push_back(failure);
      if (failure.kind == FailureKind::kReleased) open_.insert(it->second);
      leased_.erase(it);
    }
    while (!open_.empty() && static_cast<int32_t>(leased_.size()) < state.requested_lease_count) {
      leased_[++last_lease_id_] = *open_.begin();
      open_.erase(open_.begin());
    }
  }
  static Lease MakeLease(uint64_t id, uint64_t task) {
    Lease lease;
    lease.lease_id = id;
    lease.frame_digest = "frame";
    lease.tile = {0, 0, 16, 16};
    lease.block = {task, 1};
    return lease;
  }

  mutable Mutex mutex_;
  std::set<uint64_t> open_ ABSL_GUARDED_BY(mutex_);
  std::set<uint64_t> done_ ABSL_GUARDED_BY(mutex_);
  std::set<uint64_t> refused_ ABSL_GUARDED_BY(mutex_);
  std::map<uint64_t, uint64_t> leased_ ABSL_GUARDED_BY(mutex_);  // Lease id to task.
  std::vector<LeaseFailure> failures_ ABSL_GUARDED_BY(mutex_);
  WorkerState last_ ABSL_GUARDED_BY(mutex_);
  uint64_t last_lease_id_ ABSL_GUARDED_BY(mutex_) = 0;
  int synchronize_count_ ABSL_GUARDED_BY(mutex_) = 0;
  int delivery_count_ ABSL_GUARDED_BY(mutex_) = 0;
  int answer_count_ ABSL_GUARDED_BY(mutex_) = 0;
  bool offers_deliveries_ ABSL_GUARDED_BY(mutex_) = false;
  int upload_count_ ABSL_GUARDED_BY(mutex_) = 0;
  int lose_every_reply_ ABSL_GUARDED_BY(mutex_) = 0;
  bool tells_to_exit_ ABSL_GUARDED_BY(mutex_) = false;
  bool away_ ABSL_GUARDED_BY(mutex_) = false;
  bool is_of_another_version_ ABSL_GUARDED_BY(mutex_) = false;
};

// Renders at once, or waits until the gate opens.
class FakeRenderer : public SceneLoader {
 public:
  LoadResult Load(const Lease&, std::stop_token) override {
    if (on_load) on_load();
    if (!load_status.ok()) return {nullptr, load_status, load_failure_kind};
    return {std::make_unique<Scene>(this), absl::OkStatus(), FailureKind::kInternal};
  }

  std::function<void()> on_load, on_render;
  std::atomic<bool> gate_open{true};
  std::atomic<int> rendering_count{0};
  absl::Status load_status;
  absl::Status render_status;  // For the first task.
  FailureKind load_failure_kind = FailureKind::kInternal;
  size_t part_bytes = 10;

 private:
  class Scene : public LoadedScene {
   public:
    explicit Scene(FakeRenderer* renderer) : renderer_(renderer) {}
    uint64_t memory_bytes() const override { return 1; }
    absl::StatusOr<FinishedPart> Render(const Lease& lease, std::stop_token stop) const override {
      if (renderer_->on_render) renderer_->on_render();
      if (!renderer_->render_status.ok()) return std::exchange(renderer_->render_status, {});
      ++renderer_->rendering_count;
      while (!renderer_->gate_open && !stop.stop_requested()) std::this_thread::yield();
      --renderer_->rendering_count;
      if (stop.stop_requested()) return absl::CancelledError("stopped");
      FinishedPart part;
      part.lease_id = lease.lease_id;
      part.frame_digest = lease.frame_digest;
      part.tile = lease.tile;
      part.block = lease.block;
      part.exr_bytes.assign(renderer_->part_bytes, 'x');
      return part;
    }

   private:
    FakeRenderer* renderer_;
  };
};

inline AgentOptions FastOptions() {
  AgentOptions options;
  options.worker_id = "host-1-test";
  options.thread_count = 2;
  options.grace = milliseconds(200);
  options.farewell = std::chrono::seconds(20);  // Ends with the coordinator's answer.
  options.backoff_initial = milliseconds(1);
  options.backoff_max = milliseconds(5);
  options.synchronize_spacing = milliseconds(1);
  return options;
}

// Runs an agent in a thread beside the test.
class Running {
 public:
  Running(const AgentOptions& options, CoordinatorLink* link, SceneLoader* loader)
      : agent_(options, link, loader),
        thread_([this](std::stop_token stop) { status_ = agent_.Run(stop); }) {}
  absl::Status Stop() {
    thread_.request_stop();
    return Join();
  }
  absl::Status Join() {
    if (thread_.joinable()) thread_.join();
    return status_;
  }
  Agent& agent() { return agent_; }

 private:
  Agent agent_;
  absl::Status status_;
  std::jthread thread_;
};

// Waits until the condition holds, long enough for a slow machine.
inline bool Eventually(const std::function<bool()>& condition) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(200);
  while (!condition()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(milliseconds(1));
  }
  return true;
}

}  // namespace sheaf::worker
