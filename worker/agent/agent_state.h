// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// AgentState: every decision of the worker's lease loop, as a state machine without threads, clock
// or network. Agent drives it with threads and gRPC; tests/sim drives it with events. Its leases
// are in a LeaseLedger, its results in a ResultOutbox.
//
//     kWorking    takes leases
//     kAway       takes none while there is a reason (SetAwayReason), and returns what it holds
//                 after the grace period
//     kFinishing  was told to stop: running tasks continue for the grace period
//     kReleasing  returns the running tasks
//     kDone       everything is returned and delivered, or the coordinator did not answer for long
//
// Times are points of a steady clock and never decrease. Thread-compatible.
#pragma once

#include <chrono>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/status.h"
#include "worker/agent/agent_options.h"
#include "worker/agent/lease_ledger.h"
#include "worker/agent/result_outbox.h"

namespace sheaf::worker {

// Counts for the log and for tests.
struct AgentCounts {
  uint64_t accepted = 0, duplicate_equal = 0, duplicate_mismatch = 0, superseded = 0;
  uint64_t failed = 0;
};

class AgentState {
 public:
  using Clock = std::chrono::steady_clock;
  using Time = Clock::time_point;
  enum class Stage { kWorking, kAway, kFinishing, kReleasing, kDone };

  AgentState(const AgentOptions& options, Time now);

  // Enters the stage that the time and the reasons call for. Call at NextTurn, and after each
  // change below. stop_requested: an operator or the system ends this worker; never revoked.
  void Advance(Time now, bool stop_requested);
  Stage stage() const { return stage_; }
  // Whether it ends, and does not return to work.
  bool IsStopping() const { return stage_ != Stage::kWorking && stage_ != Stage::kAway; }
  // Whether nothing is left to return or to deliver.
  bool IsComplete() const { return ledger_.Empty() && outbox_.empty(); }
  // Why this worker takes no work, or "". Takes effect with the next Advance.
  void SetAwayReason(std::string reason) { away_reason_ = std::move(reason); }
  // Whether it is away and renders nothing, so that no scene is needed.
  bool NeedsNoScene() const { return stage_ == Stage::kAway && !ledger_.HasRunning(); }

  // When Advance is due, or BeginSynchronize. Each change below may bring it forward.
  Time NextTurn() const;
  bool MustSynchronize(Time now) const { return !reporting_ && now >= SynchronizeTime(); }
  // The report of a call of Synchronize, whose answer or failure goes to one of the functions after
  // it before the next report, here or of a delivery. The caller adds what it knows of scenes.
  struct Report {
    uint64_t sequence = 0;
    WorkerState state;
  };
  Report BeginSynchronize(Time now);
  void TakeAnswer(uint64_t sequence, const DesiredState& desired, Time now);
  void TakeNoAnswer(const absl::Status& status, Time now);

  // Whether TakeTask has one: a lease is queued, and the outbox has room for its result.
  bool HasTask() const { return outbox_.HasRoom() && ledger_.HasQueued(); }
  // Becomes kLoading. It ends by Finish or Fail.
  std::optional<LeaseLedger::Task> TakeTask();
  // The coordinator is to know that this worker loads a scene. Returns what HasReported takes.
  uint64_t ReportLoading();
  // Whether the coordinator knows it, or does not answer.
  bool HasReported(uint64_t loading) const { return answered_sequence_ > loading || !reachable_; }
  void BeginRendering(uint64_t lease_id) { ledger_.BeginRendering(lease_id); }
  void Finish(FinishedPart part);
  // Ends the lease without a result. kCancelled: it is returned.
  void Fail(uint64_t lease_id, FailureKind kind, const absl::Status& status);

  bool HasParts() const { return !outbox_.empty(); }
  // The parts of the next upload, the oldest ones; one upload at a time. Valid until its outcome
  // goes to one of the functions after it.
  std::vector<const FinishedPart*> NextUpload() const { return outbox_.Front(upload_parts_max_); }
  // Requires: an outcome for each part of the upload, in order.
  void TakeOutcomes(const std::vector<UploadOutcome>& outcomes);
  // Returns how long to wait before the next upload.
  Clock::duration TakeUploadFailure(const absl::Status& status);
  // Whether the next upload should be a delivery: one call with the worker's report, because the
  // coordinator offers that, the parts are small and no report is under way.
  bool DeliversState() const;
  // The report that goes with the parts of NextUpload. The call's answer or failure goes to one of
  // the functions after it.
  Report BeginDelivery(Time now);
  void TakeDelivery(uint64_t sequence, const Delivery& delivery, Time now);
  // Returns how long to wait before the next upload, which is made apart from a report. This report
  // is not answered.
  Clock::duration TakeDeliveryFailure(const absl::Status& status);

  const AgentCounts& counts() const { return counts_; }

 private:
  void AdvanceAway(Time now);
  // News follow an answered call closely; otherwise they wait for the backoff.
  Time SynchronizeTime() const;
  void RequestLeases();
  void Refuse(const FinishedPart& part, const absl::Status& status);

  const AgentOptions options_;
  LeaseLedger ledger_;
  ResultOutbox outbox_;
  AgentCounts counts_;
  Stage stage_ = Stage::kWorking;
  bool told_to_exit_ = false;
  std::string away_reason_;
  bool news_ = false;          // Since the last report.
  bool reporting_ = false;     // A report is under way.
  bool deliveries_ = false;    // The coordinator takes results with the report.
  bool reachable_ = true;      // Whether the last call was answered.
  bool refused_ = false;       // Whether it was refused, for the version of the protocol.
  bool uploads_taken_ = true;  // Whether the last upload was.
  uint64_t answered_sequence_ = 0;
  Time advanced_at_;
  Time next_synchronize_, last_synchronize_;
  Time grace_end_, farewell_end_, idle_since_;
  std::chrono::milliseconds backoff_, upload_backoff_;
  size_t upload_parts_max_;
};

}  // namespace sheaf::worker
