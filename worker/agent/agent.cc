// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/agent.h"

#include <algorithm>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "common/base/check.h"
#include "common/base/log.h"
#include "worker/agent/render_failure.h"
#include "worker/agent/task_border.h"

namespace sheaf::worker {
namespace {

// Maximum parts per upload. More would only increase the data that a broken connection repeats.
constexpr size_t kUploadPartsMax = 16;
// How long a thread waits for the coordinator to hear that it loads a scene.
constexpr absl::Duration kReportLoadingMax = absl::Seconds(2);

// Whether the coordinator will never take the result: it is not what its key says, or the work was
// not leased to this worker.
bool IsRefusal(const absl::Status& status) {
  return absl::IsInvalidArgument(status) || absl::IsPermissionDenied(status);
}

std::string Describe(const FinishedPart& part) {
  if (part.kind == TaskKind::kTraining) {
    return absl::StrCat("frame ", part.frame_digest.substr(0, 12), " training");
  }
  const std::string place =
      part.kind == TaskKind::kLight
          ? " light passes "
          : absl::StrCat(" tile ", part.tile.x0, ",", part.tile.y0, " samples ");
  return absl::StrCat("frame ", part.frame_digest.substr(0, 12), place, part.block.first, "+",
                      part.block.count);
}

}  // namespace

Agent::Agent(AgentOptions options, CoordinatorLink* link, SceneLoader* loader,
             std::function<Clock::time_point()> now)
    : options_(std::move(options)),
      link_(link),
      now_(std::move(now)),
      scenes_(loader, options_.scene_memory_bytes_max),
      outbox_(options_.unsent_bytes_max),
      last_turn_(now_()),
      backoff_(options_.backoff_initial) {
  SHEAF_CHECK(options_.thread_count >= 1 && options_.leases_ahead >= 0);
}

AgentCounts Agent::counts() const {
  const MutexLock lock(&mutex_);
  return counts_;
}

Agent::Clock::duration Agent::SinceLastTurn() const {
  const MutexLock lock(&mutex_);
  return now_() - last_turn_;
}

absl::Status Agent::Run(std::stop_token stop) {
  {
    const MutexLock lock(&mutex_);
    next_synchronize_ = next_look_ = idle_since_ = now_();
    last_synchronize_ = now_() - options_.synchronize_spacing;
  }
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
      AdvanceStage(stop.stop_requested());
      if (stage_ == Stage::kDone) break;
      if (now_() >= next_synchronize_) Synchronize();
      AdvanceStage(stop.stop_requested());
      if (stage_ == Stage::kDone) break;
      WaitForNextSynchronize(stop);
    }
    complete = ledger_.Empty() && outbox_.empty();
  }
  link_->Abort();
  for (std::jthread& thread : threads) thread.request_stop();
  threads.clear();
  if (complete) return absl::OkStatus();
  return absl::UnavailableError(
      "the coordinator did not answer; other workers render the remaining tasks again when their "
      "leases expire");
}

void Agent::AdvanceStage(bool stop_requested) {
  const Clock::time_point now = now_();
  if (!ledger_.Empty() || !outbox_.empty()) idle_since_ = now;
  const bool idle_for_long =
      options_.exit_when_idle.count() > 0 && now - idle_since_ >= options_.exit_when_idle;
  if (stage_ == Stage::kWorking || stage_ == Stage::kAway) AdvanceAway(now);
  if ((stage_ == Stage::kWorking || stage_ == Stage::kAway) &&
      (stop_requested || told_to_exit_ || idle_for_long)) {
    stage_ = Stage::kFinishing;
    grace_end_ = now + options_.grace;
    farewell_end_ = grace_end_ + options_.farewell;
    ledger_.ReleaseQueued();
    news_ = true;
    LogInfo(stop_requested  ? "stopping: finishing the running tasks"
            : told_to_exit_ ? "drained: stopping, as an operator wants"
                            : "idle: stopping");
  }
  if (stage_ == Stage::kFinishing && now >= grace_end_ && ledger_.HasRunning()) {
    stage_ = Stage::kReleasing;
    ledger_.StopRunning();
    LogInfo("the grace period is over: returning the running tasks");
  }
  if (stage_ == Stage::kWorking || stage_ == Stage::kAway) return;
  const bool is_done = ledger_.Empty() && outbox_.empty() && (!news_ || !reachable_);
  // If the coordinator does not answer, there is no reason to wait beyond the grace period.
  const bool given_up = now >= farewell_end_ || (now >= grace_end_ && !reachable_);
  if (is_done || (given_up && !ledger_.HasRunning()) || now >= farewell_end_ + options_.farewell) {
    stage_ = Stage::kDone;
  }
}

void Agent::LookAround() {
  if (!options_.why_away || now_() < next_look_) return;
  const bool frees_scenes = stage_ == Stage::kAway && !ledger_.HasRunning();
  mutex_.Unlock();
  if (frees_scenes) scenes_.Clear();
  const std::string reason = options_.why_away(scenes_.MemoryBytes());
  mutex_.Lock();
  away_reason_ = reason;
  next_look_ = now_() + options_.away_interval;
}

void Agent::AdvanceAway(Clock::time_point now) {
  if (stage_ == Stage::kWorking && !away_reason_.empty()) {
    stage_ = Stage::kAway;
    grace_end_ = now + options_.grace;
    ledger_.ReleaseQueued();
    news_ = true;
    LogInfo(absl::StrCat("takes no work: ", away_reason_));
  }
  if (stage_ == Stage::kAway && away_reason_.empty()) {
    stage_ = Stage::kWorking;
    news_ = true;
    LogInfo("takes work again");
  }
  if (stage_ == Stage::kAway && now >= grace_end_) ledger_.StopRunning();
}

WorkerState Agent::MakeState(const LeaseLedger::Snapshot& snapshot) const {
  WorkerState state;
  state.worker_id = options_.worker_id;
  state.host = options_.host;
  state.numeric_profile = options_.numeric_profile;
  state.thread_count = options_.thread_count;
  state.leases = snapshot.leases;
  state.failures = snapshot.failures;
  state.draining = stage_ != Stage::kWorking;
  state.warm_scenes = scenes_.WarmScenes();
  state.scene_memory_bytes = scenes_.MemoryBytes();
  state.pool = options_.pool;
  state.tags = options_.tags;
  state.memory_bytes = options_.memory_bytes;
  // Parts in upload still hold their leases, but keep no thread busy.
  if (!state.draining) {
    state.requested_lease_count =
        options_.thread_count + options_.leases_ahead + ledger_.CountHeld(LeasePhase::kUploading);
  }
  return state;
}

void Agent::Synchronize() {
  const LeaseLedger::Snapshot snapshot = ledger_.TakeSnapshot();
  const WorkerState state = MakeState(snapshot);
  news_ = false;
  last_synchronize_ = now_();
  mutex_.Unlock();
  absl::StatusOr<DesiredState> desired = link_->Synchronize(state);
  mutex_.Lock();
  if (!desired.ok()) {
    const bool was_refused = std::exchange(refused_, absl::IsFailedPrecondition(desired.status()));
    if (refused_ && !was_refused) {
      LogError(absl::StrCat(desired.status().message(), "; trying again every ",
                            absl::FormatDuration(absl::FromChrono(options_.refused_backoff))));
    } else if ((reachable_ && !refused_) || absl::IsPermissionDenied(desired.status())) {
      LogWarning(absl::StrCat(desired.status().message(), "; trying again"));
    }
    reachable_ = false;
    answered_.NotifyAll();
    news_ = true;
    next_synchronize_ = now_() + (refused_ ? options_.refused_backoff : backoff_);
    backoff_ = std::min(backoff_ * 2, options_.backoff_max);
    return;
  }
  if (!reachable_) LogInfo("the coordinator answers again");
  reachable_ = true;
  refused_ = false;
  answered_sequence_ = snapshot.sequence;
  answered_.NotifyAll();
  backoff_ = options_.backoff_initial;
  next_synchronize_ = now_() + desired->next_synchronize;
  told_to_exit_ |= desired->exit;
  const int new_count = ledger_.Apply(snapshot.sequence, desired->leases);
  // Granted before the coordinator knew that this worker is stopping.
  if (stage_ != Stage::kWorking && ledger_.HasQueued()) {
    ledger_.ReleaseQueued();
    news_ = true;
  }
  if (new_count > 0) work_.NotifyAll();
}

void Agent::WaitForNextSynchronize(std::stop_token stop) {
  Clock::time_point until = next_synchronize_;
  if (options_.why_away) until = std::min(until, next_look_);
  if (stage_ == Stage::kFinishing) until = std::min(until, grace_end_);
  if (stage_ == Stage::kAway && now_() < grace_end_) until = std::min(until, grace_end_);
  const auto has_news = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return HasNews(); };
  const bool stopping = stage_ != Stage::kWorking && stage_ != Stage::kAway;
  const absl::Duration duration =
      absl::FromChrono(std::max(until - now_(), Clock::duration::zero()));
  if (stopping) {
    control_.WaitFor(&mutex_, duration, has_news);
  } else {
    control_.WaitFor(&mutex_, std::move(stop), duration, has_news);
  }
  if (HasNews()) next_synchronize_ = last_synchronize_ + options_.synchronize_spacing;
  if (HasNews() && next_synchronize_ > now_()) {
    control_.WaitFor(&mutex_, absl::FromChrono(next_synchronize_ - now_()), [] { return false; });
  }
}

void Agent::RenderLoop(std::stop_token ended) {
  while (true) {
    std::optional<LeaseLedger::Task> task;
    {
      const MutexLock lock(&mutex_);
      const auto has_work = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
        return outbox_.HasRoom() && ledger_.HasQueued();
      };
      if (!work_.Wait(&mutex_, ended, has_work)) return;
      task = ledger_.TakeNext();
    }
    RenderOne(*task);
  }
}

void Agent::ReportLoading(const LeaseLedger::Task& task) {
  if (!scenes_.MustLoad(task.lease)) return;
  const MutexLock lock(&mutex_);
  const uint64_t before = ledger_.sequence();
  news_ = true;
  control_.NotifyOne();
  const auto answered = [this, before]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) {
    return answered_sequence_ > before || !reachable_;
  };
  answered_.WaitFor(&mutex_, task.stop, kReportLoadingMax, answered);
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
    ledger_.BeginRendering(id);
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
  ledger_.Finish(id);
  outbox_.Push(*std::move(part));
  uploads_.NotifyOne();
  RequestLeases();  // The next task shall be here before this part has arrived there.
}

void Agent::RequestLeases() {
  const bool enough = ledger_.CountHeld(LeasePhase::kQueued) >= options_.leases_ahead;
  if (enough && stage_ == Stage::kWorking) return;
  news_ = true;
  control_.NotifyOne();
}

void Agent::Fail(uint64_t lease_id, FailureKind kind, const absl::Status& status) {
  if (absl::IsCancelled(status)) {
    ledger_.Fail(lease_id, FailureKind::kReleased, "the worker gives it back");
  } else {
    const std::string text = absl::StrCat("lease ", lease_id, " failed: ", status.message());
    options_.warns_of_failed_leases ? LogWarning(text) : LogInfo(text);
    ledger_.Fail(lease_id, kind, std::string(status.message()),
                 ShortageOf(status).value_or(CacheShortage()));
    ++counts_.failed;
  }
  news_ = true;
  control_.NotifyOne();
}

void Agent::UploadLoop(std::stop_token ended) {
  MutexLock lock(&mutex_);
  size_t part_count_max = kUploadPartsMax;
  std::chrono::milliseconds backoff = options_.backoff_initial;
  const auto has_parts = [this]()
                             ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return !outbox_.empty(); };
  while (uploads_.Wait(&mutex_, ended, has_parts) && !ended.stop_requested()) {
    const std::vector<const FinishedPart*> parts = outbox_.Front(part_count_max);
    lock.Unlock();
    const absl::StatusOr<std::vector<UploadOutcome>> outcomes =
        link_->UploadResults(options_.worker_id, parts);
    lock.Lock();
    if (outcomes.ok()) {
      SHEAF_CHECK(outcomes->size() == parts.size());
      if (!uploads_taken_) LogInfo("the coordinator accepts results again");
      uploads_taken_ = true;
      TakeOutcomes(parts, *outcomes);
      part_count_max = kUploadPartsMax;
      backoff = options_.backoff_initial;
    } else if (IsRefusal(outcomes.status()) && parts.size() > 1) {
      part_count_max = 1;  // One of them is refused; find it.
    } else if (IsRefusal(outcomes.status())) {
      LogError(absl::StrCat("refused: ", Describe(*parts.front()), ": ",
                            std::string(outcomes.status().message())));
      Refuse(*parts.front(), outcomes.status());
    } else {
      if (uploads_taken_) {
        LogWarning(absl::StrCat("the coordinator accepts no results: ", outcomes.status().message(),
                                "; they are kept and sent again"));
      }
      uploads_taken_ = false;
      uploads_.WaitFor(&mutex_, ended, absl::FromChrono(backoff), [] { return false; });
      backoff = std::min(backoff * 2, options_.backoff_max);
    }
  }
}

void Agent::Refuse(const FinishedPart& part, const absl::Status& status) {
  ledger_.Fail(part.lease_id, FailureKind::kInternal, std::string(status.message()));
  ++counts_.failed;
  outbox_.Pop();
  news_ = true;
  work_.NotifyAll();
  control_.NotifyOne();
}

void Agent::TakeOutcomes(const std::vector<const FinishedPart*>& parts,
                         const std::vector<UploadOutcome>& outcomes) {
  for (size_t i = 0; i < parts.size(); ++i) {
    switch (outcomes[i]) {
      case UploadOutcome::kAccepted:
        ++counts_.accepted;
        break;
      case UploadOutcome::kDuplicateEqual:
        ++counts_.duplicate_equal;
        break;
      case UploadOutcome::kSuperseded:
        ++counts_.superseded;
        break;
      case UploadOutcome::kDuplicateMismatch:
        ++counts_.duplicate_mismatch;
        LogError(absl::StrCat("another worker's result differs: ", Describe(*parts[i]),
                              "; check this machine's memory and build"));
        break;
    }
    ledger_.Acknowledge(parts[i]->lease_id);
    outbox_.Pop();
  }
  work_.NotifyAll();
  RequestLeases();
}

}  // namespace sheaf::worker
