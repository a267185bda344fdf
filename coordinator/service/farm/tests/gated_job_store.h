// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// GatedJobStore: a job store for tests that is slow, or refuses changes, when a test says so.
#pragma once

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "common/base/mutex.h"
#include "coordinator/store/job_store.h"

namespace sheaf::coordinator {

// Holds every EndJob and AddRound at the gate until it is opened, and on request WritePart; all
// else goes straight through.
class GatedJobStore : public JobStore {
 public:
  explicit GatedJobStore(std::unique_ptr<JobStore> store) : store_(std::move(store)) {}

  void WaitUntilSomeoneIsThere() {
    const MutexLock lock(&mutex_);
    changed_.Wait(&mutex_, [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return waiting_ > 0; });
  }
  void Open() {
    const MutexLock lock(&mutex_);
    open_ = true;
    changed_.NotifyAll();
  }

  absl::Status EndJob(uint64_t job_id, JobPhase phase, const std::string& failure,
                      absl::Time end_time, absl::Duration wall) override {
    PassTheGate();
    if (!refuses_ends_) return store_->EndJob(job_id, phase, failure, end_time, wall);
    ++ends_refused_;
    return Full();
  }
  absl::Status WriteFailures(uint64_t job_id, const FailureLog& failures) override {
    if (refuses_failures_) return Full();
    return store_->WriteFailures(job_id, failures);
  }
  absl::Status WriteTroubles(const std::vector<TaskTrouble>& troubles) override {
    return store_->WriteTroubles(troubles);
  }
  absl::StatusOr<std::vector<TaskTrouble>> LoadTroubles(uint64_t job_id) override {
    return store_->LoadTroubles(job_id);
  }
  absl::Status WriteQuarantine(const QuarantineRecord& record) override {
    if (refuses_quarantines_) return Full();
    return store_->WriteQuarantine(record);
  }
  absl::Status RemoveQuarantine(const std::string& identity) override {
    return store_->RemoveQuarantine(identity);
  }
  absl::Status WriteShare(const ShareSubject& subject, const ShareSetting& setting) override {
    return store_->WriteShare(subject, setting);
  }
  absl::Status RemoveShare(const ShareSubject& subject) override {
    return store_->RemoveShare(subject);
  }
  absl::StatusOr<std::map<ShareSubject, ShareSetting>> LoadShares() override {
    return store_->LoadShares();
  }
  absl::StatusOr<std::vector<QuarantineRecord>> LoadQuarantines() override {
    return store_->LoadQuarantines();
  }
  absl::Status SetWarning(uint64_t job_id, const std::string& warning) override {
    return store_->SetWarning(job_id, warning);
  }
  absl::StatusOr<std::vector<PartRow>> FindPartsOf(const std::string& identity) override {
    return store_->FindPartsOf(identity);
  }
  absl::Status ChangeJob(uint64_t job_id, const JobChange& change) override {
    ++control_writes_;
    return full_ ? Full() : store_->ChangeJob(job_id, change);
  }
  absl::Status ReleaseJob(uint64_t job_id) override { return store_->ReleaseJob(job_id); }
  absl::Status AppendEvents(const std::vector<JobEvent>& events) override {
    return store_->AppendEvents(events);
  }
  absl::StatusOr<std::vector<JobEvent>> LoadEvents(uint64_t job_id) override {
    return store_->LoadEvents(job_id);
  }
  absl::Status WriteDrains(const std::vector<DrainRecord>& records) override {
    return store_->WriteDrains(records);
  }
  absl::Status RemoveDrains(const std::vector<std::string>& worker_ids) override {
    return store_->RemoveDrains(worker_ids);
  }
  absl::StatusOr<std::vector<DrainRecord>> LoadDrains() override { return store_->LoadDrains(); }
  absl::StatusOr<std::map<uint64_t, uint64_t>> PartsBytesByJob() override {
    return store_->PartsBytesByJob();
  }
  absl::Status RemoveJob(uint64_t job_id) override { return store_->RemoveJob(job_id); }
  absl::StatusOr<std::vector<StoredJob>> LoadJobs() override { return store_->LoadJobs(); }
  absl::StatusOr<LoadedParts> LoadParts(uint64_t job_id) override {
    return store_->LoadParts(job_id);
  }
  absl::StatusOr<CreatedJob> CreateJob(const JobSpec& spec, const std::string& request_id,
                                       absl::Time create_time) override {
    return store_->CreateJob(spec, request_id, create_time);
  }
  absl::StatusOr<std::optional<uint64_t>> FindRequest(const std::string& request_id) override {
    return store_->FindRequest(request_id);
  }
  absl::Status WritePart(const PartRow& row, const std::string& bytes) override {
    if (holds_parts_) PassTheGate();
    return full_ ? Full() : store_->WritePart(row, bytes);
  }
  std::vector<absl::Status> WriteParts(std::span<const NewPart> parts) override {
    if (holds_parts_) PassTheGate();
    if (full_) return std::vector<absl::Status>(parts.size(), Full());
    return store_->WriteParts(parts);
  }
  absl::Status AddStoredPart(const PartRow& row, const std::string& bytes) override {
    if (holds_parts_) PassTheGate();
    return full_ ? Full() : store_->AddStoredPart(row, bytes);
  }
  std::optional<PutTicket> TicketFor(const PartRow& row) override { return store_->TicketFor(row); }
  absl::Status Probe() override { return full_ ? Full() : store_->Probe(); }
  absl::StatusOr<std::optional<PartRow>> FindPart(const PartKey& key) override {
    return store_->FindPart(key);
  }
  absl::StatusOr<std::vector<PartRow>> FindTileParts(const FrameId& frame, const PixelRect& tile,
                                                     TaskKind kind) override {
    return store_->FindTileParts(frame, tile, kind);
  }
  absl::StatusOr<std::vector<RoundRecord>> LoadFrameRounds(const FrameId& frame) override {
    return store_->LoadFrameRounds(frame);
  }
  absl::StatusOr<std::vector<PartRow>> ListParts(uint64_t job_id) override {
    return store_->ListParts(job_id);
  }
  absl::StatusOr<std::vector<TileCost>> TileCosts(const FrameId& frame) override {
    return store_->TileCosts(frame);
  }
  absl::StatusOr<std::string> ReadPart(const PartRow& row) override {
    return store_->ReadPart(row);
  }
  absl::Status RemovePart(const PartRow& row) override {
    if (!keeps_parts_ && removals_allowed_-- > 0) return store_->RemovePart(row);
    ++removals_refused_;
    return Full();
  }
  absl::Status RemoveFrameParts(const FrameId& frame) override {
    return store_->RemoveFrameParts(frame);
  }
  absl::StatusOr<std::string> OutputPath(const FrameId& frame) override {
    return store_->OutputPath(frame);
  }
  absl::Status DeliverFrame(const FrameId& frame, const DeliveredFrame& delivered) override {
    return store_->DeliverFrame(frame, delivered);
  }
  void NoteUsage(const UsageOf& of, const Usage& usage) override { store_->NoteUsage(of, usage); }
  absl::Status WriteUsage() override { return store_->WriteUsage(); }
  absl::StatusOr<std::vector<UsageRow>> LoadUsage(const UsageQuery& query) override {
    return store_->LoadUsage(query);
  }
  absl::Status AddRound(const FrameId& frame, const RoundRecord& round) override {
    PassTheGate();
    return store_->AddRound(frame, round);
  }
  absl::StatusOr<std::vector<StoredRound>> LoadRounds(uint64_t job_id, bool with_cells) override {
    if (refuses_rounds_) return absl::UnavailableError("reading x: input/output error");
    return store_->LoadRounds(job_id, with_cells);
  }
  absl::Status ReopenJob(uint64_t job_id, const std::vector<ReopenedFrame>& frames) override {
    return store_->ReopenJob(job_id, frames);
  }
  absl::StatusOr<std::optional<FrameId>> OldestDeliveredWithParts() override {
    return store_->OldestDeliveredWithParts();
  }
  uint64_t PartsBytes() const override { return store_->PartsBytes(); }
  uint64_t FirstLeaseId() const override { return store_->FirstLeaseId(); }
  int64_t LostCommits() const override { return store_->LostCommits(); }

  std::atomic<bool> full_ = false;  // Whether the disk takes no parts, pauses and priorities.
  std::atomic<bool> holds_parts_ = false;
  std::atomic<bool> keeps_parts_ = false;              // Whether the disk removes no parts.
  std::atomic<int64_t> removals_allowed_ = INT64_MAX;  // Maximum number of parts to remove.
  std::atomic<int> removals_refused_ = 0;
  std::atomic<bool> refuses_rounds_ = false;  // Whether the disk reads no rounds.
  std::atomic<bool> refuses_ends_ = false;    // Whether the disk takes no ends of jobs.
  std::atomic<int> ends_refused_ = 0;
  std::atomic<bool> refuses_failures_ = false;     // Whether the disk takes no failures of jobs.
  std::atomic<bool> refuses_quarantines_ = false;  // Whether it takes no quarantines.
  std::atomic<int> control_writes_ = 0;  // Pauses and priorities, also those that failed.

 private:
  static absl::Status Full() { return absl::ResourceExhaustedError("writing x: no space left"); }
  void PassTheGate() {
    const MutexLock lock(&mutex_);
    ++waiting_;
    changed_.NotifyAll();
    changed_.Wait(&mutex_, [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(mutex_) { return open_; });
  }

  const std::unique_ptr<JobStore> store_;
  Mutex mutex_;
  CondVar changed_;
  int waiting_ ABSL_GUARDED_BY(mutex_) = 0;
  bool open_ ABSL_GUARDED_BY(mutex_) = false;
};

}  // namespace sheaf::coordinator
