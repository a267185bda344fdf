// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "worker/agent/agent_state.h"

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/time/time.h"
#include "common/base/check.h"
#include "common/base/log.h"

namespace sheaf::worker {
namespace {

// Maximum parts per upload. More would only increase the data that a broken connection repeats.
constexpr size_t kUploadPartsMax = 16;

// A delivery is small enough that it does not delay the worker's next report by much: 8 s at 1
// Mbit/s, below the deadline of its call.
constexpr uint64_t kDeliveryBytesMax = uint64_t{1} << 20;
// While a report is under way, its answer is what the next turn waits for; calls have deadlines
// below this.
constexpr std::chrono::seconds kReportMax{30};

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

AgentState::AgentState(const AgentOptions& options, Time now)
    : options_(options),
      outbox_(options_.unsent_bytes_max),
      advanced_at_(now),
      next_synchronize_(now),
      last_synchronize_(now - options_.synchronize_spacing),
      idle_since_(now),
      backoff_(options_.backoff_initial),
      upload_backoff_(options_.backoff_initial),
      upload_parts_max_(kUploadPartsMax) {
  SHEAF_CHECK(options_.thread_count >= 1 && options_.leases_ahead >= 0);
}

void AgentState::Advance(Time now, bool stop_requested) {
  advanced_at_ = now;
  if (!IsComplete()) idle_since_ = now;
  const bool idle_for_long =
      options_.exit_when_idle.count() > 0 && now - idle_since_ >= options_.exit_when_idle;
  if (!IsStopping()) AdvanceAway(now);
  if (!IsStopping() && (stop_requested || told_to_exit_ || idle_for_long)) {
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
  if (!IsStopping()) return;
  const bool is_done = IsComplete() && (!news_ || !reachable_);
  // If the coordinator does not answer, there is no reason to wait beyond the grace period.
  const bool given_up = now >= farewell_end_ || (now >= grace_end_ && !reachable_);
  if (is_done || (given_up && !ledger_.HasRunning()) || now >= farewell_end_ + options_.farewell) {
    stage_ = Stage::kDone;
  }
}

void AgentState::AdvanceAway(Time now) {
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

AgentState::Time AgentState::SynchronizeTime() const {
  if (reporting_) return last_synchronize_ + kReportMax;
  if (news_ && reachable_) return last_synchronize_ + options_.synchronize_spacing;
  return next_synchronize_;
}

AgentState::Time AgentState::NextTurn() const {
  Time next = SynchronizeTime();
  // Advance has seen the deadlines that have passed.
  const auto consider = [&](Time deadline) {
    if (deadline > advanced_at_) next = std::min(next, deadline);
  };
  if (stage_ != Stage::kWorking) consider(grace_end_);
  if (IsStopping()) {
    consider(farewell_end_);
    consider(farewell_end_ + options_.farewell);
  } else if (options_.exit_when_idle.count() > 0 && IsComplete()) {
    consider(idle_since_ + options_.exit_when_idle);
  }
  return next;
}

AgentState::Report AgentState::BeginSynchronize(Time now) {
  LeaseLedger::Snapshot snapshot = ledger_.TakeSnapshot();
  news_ = false;
  reporting_ = true;
  last_synchronize_ = now;
  Report report;
  report.sequence = snapshot.sequence;
  WorkerState& state = report.state;
  state.worker_id = options_.worker_id;
  state.host = options_.host;
  state.numeric_profile = options_.numeric_profile;
  state.thread_count = options_.thread_count;
  state.leases = std::move(snapshot.leases);
  state.failures = std::move(snapshot.failures);
  state.draining = stage_ != Stage::kWorking;
  state.pool = options_.pool;
  state.tags = options_.tags;
  state.memory_bytes = options_.memory_bytes;
  // Parts in upload still hold their leases, but keep no thread busy.
  if (!state.draining) {
    state.requested_lease_count =
        options_.thread_count + options_.leases_ahead + ledger_.CountHeld(LeasePhase::kUploading);
  }
  return report;
}

void AgentState::TakeAnswer(uint64_t sequence, const DesiredState& desired, Time now) {
  if (!reachable_) LogInfo("the coordinator answers again");
  reachable_ = true;
  refused_ = false;
  reporting_ = false;
  deliveries_ = desired.deliveries;
  answered_sequence_ = sequence;
  backoff_ = options_.backoff_initial;
  next_synchronize_ = now + desired.next_synchronize;
  told_to_exit_ |= desired.exit;
  ledger_.Apply(sequence, desired.leases);
  // Granted before the coordinator knew that this worker is stopping.
  if (stage_ != Stage::kWorking && ledger_.HasQueued()) {
    ledger_.ReleaseQueued();
    news_ = true;
  }
}

void AgentState::TakeNoAnswer(const absl::Status& status, Time now) {
  const bool was_refused = std::exchange(refused_, absl::IsFailedPrecondition(status));
  if (refused_ && !was_refused) {
    LogError(absl::StrCat(status.message(), "; trying again every ",
                          absl::FormatDuration(absl::FromChrono(options_.refused_backoff))));
  } else if ((reachable_ && !refused_) || absl::IsPermissionDenied(status)) {
    LogWarning(absl::StrCat(status.message(), "; trying again"));
  }
  reachable_ = false;
  reporting_ = false;
  news_ = true;
  next_synchronize_ = now + (refused_ ? options_.refused_backoff : backoff_);
  backoff_ = std::min(backoff_ * 2, options_.backoff_max);
}

std::optional<LeaseLedger::Task> AgentState::TakeTask() {
  if (!HasTask()) return std::nullopt;
  return ledger_.TakeNext();
}

uint64_t AgentState::ReportLoading() {
  news_ = true;
  return ledger_.sequence();
}

void AgentState::Finish(FinishedPart part) {
  ledger_.Finish(part.lease_id);
  outbox_.Push(std::move(part));
  // A delivery requests the next lease. Otherwise that is to arrive before this upload completes.
  if (!DeliversState()) RequestLeases();
}

void AgentState::Fail(uint64_t lease_id, FailureKind kind, const absl::Status& status) {
  news_ = true;
  if (absl::IsCancelled(status)) {
    ledger_.Fail(lease_id, FailureKind::kReleased, "the worker gives it back");
    return;
  }
  const std::string text = absl::StrCat("lease ", lease_id, " failed: ", status.message());
  options_.warns_of_failed_leases ? LogWarning(text) : LogInfo(text);
  ledger_.Fail(lease_id, kind, std::string(status.message()),
               ShortageOf(status).value_or(CacheShortage()));
  ++counts_.failed;
}

// A worker that stops tells the coordinator at once what has ended.
void AgentState::RequestLeases() {
  const bool enough = ledger_.CountHeld(LeasePhase::kQueued) >= options_.leases_ahead;
  if (!enough || stage_ != Stage::kWorking) news_ = true;
}

void AgentState::TakeOutcomes(const std::vector<UploadOutcome>& outcomes) {
  if (!uploads_taken_) LogInfo("the coordinator accepts results again");
  uploads_taken_ = true;
  upload_parts_max_ = kUploadPartsMax;
  upload_backoff_ = options_.backoff_initial;
  for (const UploadOutcome outcome : outcomes) {
    SHEAF_CHECK(!outbox_.empty());
    const FinishedPart& part = *outbox_.Front(1).front();
    switch (outcome) {
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
        LogError(absl::StrCat("another worker's result differs: ", Describe(part),
                              "; check this machine's memory and build"));
        break;
    }
    ledger_.Acknowledge(part.lease_id);
    outbox_.Pop();
  }
  RequestLeases();
}

AgentState::Clock::duration AgentState::TakeUploadFailure(const absl::Status& status) {
  if (IsRefusal(status)) {
    const std::vector<const FinishedPart*> parts = NextUpload();
    if (parts.size() == 1) Refuse(*parts.front(), status);
    upload_parts_max_ = 1;  // One of several is refused; find it.
    return Clock::duration::zero();
  }
  if (uploads_taken_) {
    LogWarning(absl::StrCat("the coordinator accepts no results: ", status.message(),
                            "; they are kept and sent again"));
  }
  uploads_taken_ = false;
  const std::chrono::milliseconds wait = upload_backoff_;
  upload_backoff_ = std::min(upload_backoff_ * 2, options_.backoff_max);
  return wait;
}

bool AgentState::DeliversState() const {
  // After a failure the two calls are made apart, to tell what fails.
  if (!deliveries_ || reporting_ || !reachable_ || !uploads_taken_) return false;
  if (upload_parts_max_ < kUploadPartsMax) return false;
  uint64_t bytes = 0;
  for (const FinishedPart* part : NextUpload()) bytes += part->exr_bytes.size();
  return bytes > 0 && bytes <= kDeliveryBytesMax;
}

AgentState::Report AgentState::BeginDelivery(Time now) {
  Report report = BeginSynchronize(now);
  // The leases of these parts end before the report is looked at.
  report.state.requested_lease_count =
      std::max(0, report.state.requested_lease_count - static_cast<int32_t>(NextUpload().size()));
  return report;
}

void AgentState::TakeDelivery(uint64_t sequence, const Delivery& delivery, Time now) {
  TakeAnswer(sequence, delivery.desired, now);  // First: with its leases, no further are requested.
  TakeOutcomes(delivery.outcomes);
}

AgentState::Clock::duration AgentState::TakeDeliveryFailure(const absl::Status& status) {
  reporting_ = false;
  news_ = true;
  if (!IsRefusal(status)) return TakeUploadFailure(status);
  // The report may be what is refused, and the results durable: they are uploaded alone.
  upload_parts_max_ = 1;
  return Clock::duration::zero();
}

// Drops a part that the coordinator says is not what its key says.
void AgentState::Refuse(const FinishedPart& part, const absl::Status& status) {
  LogError(absl::StrCat("refused: ", Describe(part), ": ", status.message()));
  ledger_.Fail(part.lease_id, FailureKind::kInternal, std::string(status.message()));
  ++counts_.failed;
  outbox_.Pop();
  news_ = true;
}

}  // namespace sheaf::worker
