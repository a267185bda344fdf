// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/agent.h"

#include <algorithm>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "absl/time/time.h"
#include "common/base/check.h"
#include "worker/agent/render_failure.h"
#include "worker/agent/task_border.h"

namespace sheaf::worker {
namespace {

// How long a thread waits for the coordinator to hear that it loads a scene.
constexpr absl::Duration kReportLoadingMax = absl::Seconds(2);

}  // namespace

Agent::Agent(AgentOptions options, CoordinatorLink* link, SceneLoader* loader,
             std::function<Clock::time_point()> now)
    : options_(std::move(options)),
      link_(link),
      now_(std::move(now)),
      scenes_(loader, options_.scene_memory_bytes_max),
      state_(options_, now_()),
      next_look_(now_()),
      last_turn_(now_()) {}

AgentCounts Agent::counts() const {
  const MutexLock lock(&mutex_);
  return state_.counts();
}

Agent::Clock::duration Agent::SinceLastTurn() const {
  const MutexLock lock(&mutex_);
  return now_() - last_turn_;
}

absl::Status Agent::Run(std::stop_token stop) {
  std::vector<std::jthread> threads;
  for (int32_t i = 0; i < options_.thread_count; ++i) {
    threads.emplace_back([this](std::stop_token ended) { RenderLoop(ended); });
  }
  threads.emplace_back([this](std::stop_token ended) { UploadLoop(ended); });

  bool complete = false;
  {
    const MutexLock lock(&mutex_);
    while (true) {
      last_turn_ = now_();
      LookAround();
      state_.Advance(now_(), stop.stop_requested());
      if (state_.stage() == AgentState::Stage::kDone) break;
      if (state_.MustSynchronize(now_())) Synchronize();
      state_.Advance(now_(), stop.stop_requested());
      if (state_.stage() == AgentState::Stage::kDone) break;
      WaitForNextTurn(stop);
    }
    complete = state_.IsComplete();
  }
  link_->Abort();
  for (std::jthread& thread : threads) thread.request_stop();
  threads.clear();
  if (complete) return absl::OkStatus();
  return absl::UnavailableError(
      "the coordinator did not answer; other workers render the remaining tasks again when their "
      "leases expire");
}

void Agent::LookAround() {
  if (!options_.why_away || now_() < next_look_) return;
  const bool frees_scenes = state_.NeedsNoScene();
  mutex_.Unlock();
  if (frees_scenes) scenes_.Clear();
  std::string reason = options_.why_away(scenes_.MemoryBytes());
  mutex_.Lock();
  state_.SetAwayReason(std::move(reason));
  next_look_ = now_() + options_.away_interval;
}

void Agent::AddScenes(WorkerState* state) {
  state->warm_scenes = scenes_.WarmScenes();
  state->scene_memory_bytes = scenes_.MemoryBytes();
}

void Agent::Synchronize() {
  AgentState::Report report = state_.BeginSynchronize(now_());
  AddScenes(&report.state);
  mutex_.Unlock();
  const absl::StatusOr<DesiredState> desired = link_->Synchronize(report.state);
  mutex_.Lock();
  if (desired.ok()) {
    state_.TakeAnswer(report.sequence, *desired, now_());
  } else {
    state_.TakeNoAnswer(desired.status(), now_());
  }
  answered_.NotifyAll();
  if (state_.HasTask()) work_.NotifyAll();
}

void Agent::WaitForNextTurn(std::stop_token stop) {
  const auto next_turn = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return options_.why_away ? std::min(state_.NextTurn(), next_look_) : state_.NextTurn();
  };
  const Clock::time_point until = next_turn();
  const auto comes_forward = [&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return next_turn() < until;
  };
  const absl::Duration duration =
      absl::FromChrono(std::max(until - now_(), Clock::duration::zero()));
  if (state_.IsStopping()) {
    control_.WaitFor(&mutex_, duration, comes_forward);
  } else {
    control_.WaitFor(&mutex_, std::move(stop), duration, comes_forward);
  }
}

void Agent::RenderLoop(std::stop_token ended) {
  while (true) {
    std::optional<LeaseLedger::Task> task;
    {
      const MutexLock lock(&mutex_);
      const auto has_task = [this]()
                                ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return state_.HasTask(); };
      if (!work_.Wait(&mutex_, ended, has_task)) return;
      task = state_.TakeTask();
    }
    RenderOne(*task);
  }
}

void Agent::ReportLoading(const LeaseLedger::Task& task) {
  if (!scenes_.MustLoad(task.lease)) return;
  const MutexLock lock(&mutex_);
  const uint64_t loading = state_.ReportLoading();
  control_.NotifyOne();
  const auto has_reported = [this, loading]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return state_.HasReported(loading);
  };
  answered_.WaitFor(&mutex_, task.stop, kReportLoadingMax, has_reported);
}

void Agent::RenderOne(const LeaseLedger::Task& task) {
  const uint64_t id = task.lease.lease_id;
  ReportLoading(task);
  const SharedLoadResult loaded = scenes_.Get(task.lease, task.stop);
  {
    const MutexLock lock(&mutex_);
    if (loaded.scene == nullptr) {
      Fail(id, loaded.failure_kind, loaded.status);
      return;
    }
    state_.BeginRendering(id);
  }
  absl::StatusOr<FinishedPart> part;
  const absl::Status in_memory =
      CatchOutOfMemory("rendering", [&] { part = loaded.scene->Render(task.lease, task.stop); });
  const absl::Status status = in_memory.ok() ? part.status() : in_memory;
  const bool stays_good = status.ok() || absl::IsCancelled(status) || absl::IsUnavailable(status);
  if (!stays_good) scenes_.Drop(task.lease, loaded.scene);
  const MutexLock lock(&mutex_);
  if (!status.ok()) {
    Fail(id, RenderFailureKind(status), status);
    return;
  }
  state_.Finish(*std::move(part));
  uploads_.NotifyOne();
  control_.NotifyOne();
}

void Agent::Fail(uint64_t lease_id, FailureKind kind, const absl::Status& status) {
  state_.Fail(lease_id, kind, status);
  control_.NotifyOne();
}

void Agent::UploadLoop(std::stop_token ended) {
  const MutexLock lock(&mutex_);
  const auto has_parts = [this]()
                             ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return state_.HasParts(); };
  while (uploads_.Wait(&mutex_, ended, has_parts) && !ended.stop_requested()) {
    const Clock::duration wait = state_.DeliversState() ? Deliver() : Upload();
    if (wait > Clock::duration::zero()) {
      uploads_.WaitFor(&mutex_, ended, absl::FromChrono(wait), [] { return false; });
    }
    work_.NotifyAll();
    control_.NotifyOne();
  }
}

Agent::Clock::duration Agent::Upload() {
  const std::vector<const FinishedPart*> parts = state_.NextUpload();
  mutex_.Unlock();
  const absl::StatusOr<std::vector<UploadOutcome>> outcomes =
      link_->UploadResults(options_.worker_id, parts);
  mutex_.Lock();
  if (!outcomes.ok()) return state_.TakeUploadFailure(outcomes.status());
  SHEAF_CHECK(outcomes->size() == parts.size());
  state_.TakeOutcomes(*outcomes);
  return Clock::duration::zero();
}

Agent::Clock::duration Agent::Deliver() {
  const std::vector<const FinishedPart*> parts = state_.NextUpload();
  AgentState::Report report = state_.BeginDelivery(now_());
  AddScenes(&report.state);
  mutex_.Unlock();
  const absl::StatusOr<Delivery> delivery = link_->Deliver(report.state, parts);
  mutex_.Lock();
  if (!delivery.ok()) return state_.TakeDeliveryFailure(delivery.status());
  SHEAF_CHECK(delivery->outcomes.size() == parts.size());
  state_.TakeDelivery(report.sequence, *delivery, now_());
  answered_.NotifyAll();
  return Clock::duration::zero();
}

}  // namespace sheaf::worker
