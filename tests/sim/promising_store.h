// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// PromisingStore: the coordinator's real store on the simulated disk; it notes what each call
// promised, and has the promises checked by what a new life reads.
#pragma once

#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "coordinator/store/sql_job_store.h"
#include "tests/sim/machine.h"
#include "tests/sim/promises.h"

namespace sheaf::sim {

class PromisingStore : public coordinator::JobStore {
 public:
  using FrameId = coordinator::FrameId;
  using PartRow = coordinator::PartRow;

  PromisingStore(std::unique_ptr<coordinator::SqlJobStore> store, Machine* machine,
                 Promises* promises)
      : store_(std::move(store)), machine_(*machine), promises_(*promises) {}

  std::string PartPath(const PartRow& row) const { return store_->PartPath(row); }

  absl::StatusOr<std::vector<coordinator::StoredJob>> LoadJobs() override {
    auto jobs = store_->LoadJobs();
    if (jobs.ok()) promises_.CheckJobs(*jobs);
    return jobs;
  }
  absl::StatusOr<LoadedParts> LoadParts(uint64_t job_id) override {
    auto parts = store_->LoadParts(job_id);
    if (parts.ok()) promises_.CheckParts(job_id, *parts);
    return parts;
  }
  absl::StatusOr<CreatedJob> CreateJob(const coordinator::JobSpec& spec,
                                       const std::string& request_id,
                                       absl::Time create_time) override {
    auto created = store_->CreateJob(spec, request_id, create_time);
    if (created.ok() && created->is_new) promises_.Created(created->job_id, spec, Certain());
    return created;
  }
  absl::StatusOr<std::optional<uint64_t>> FindRequest(const std::string& request_id) override {
    return store_->FindRequest(request_id);
  }
  absl::Status EndJob(uint64_t job_id, coordinator::JobPhase phase, const std::string& failure,
                      absl::Time end_time, absl::Duration wall) override {
    absl::Status status = store_->EndJob(job_id, phase, failure, end_time, wall);
    promises_.Ended(job_id, phase, Certain(status));
    return status;
  }
  absl::Status WriteFailures(uint64_t job_id, const coordinator::FailureLog& failures) override {
    return store_->WriteFailures(job_id, failures);
  }
  absl::Status WriteTroubles(const std::vector<coordinator::TaskTrouble>& troubles) override {
    return store_->WriteTroubles(troubles);
  }
  absl::StatusOr<std::vector<coordinator::TaskTrouble>> LoadTroubles(uint64_t job_id) override {
    return store_->LoadTroubles(job_id);
  }
  absl::Status WriteQuarantine(const coordinator::QuarantineRecord& record) override {
    absl::Status status = store_->WriteQuarantine(record);
    promises_.Quarantined(record, Certain(status));
    return status;
  }
  absl::Status RemoveQuarantine(const std::string& identity) override {
    absl::Status status = store_->RemoveQuarantine(identity);
    promises_.Lifted(identity, Certain(status));
    return status;
  }
  absl::Status WriteShare(const coordinator::ShareSubject& subject,
                          const coordinator::ShareSetting& setting) override {
    return store_->WriteShare(subject, setting);
  }
  absl::Status RemoveShare(const coordinator::ShareSubject& subject) override {
    return store_->RemoveShare(subject);
  }
  absl::StatusOr<std::map<coordinator::ShareSubject, coordinator::ShareSetting>> LoadShares()
      override {
    return store_->LoadShares();
  }
  absl::StatusOr<std::vector<coordinator::QuarantineRecord>> LoadQuarantines() override {
    auto records = store_->LoadQuarantines();
    if (records.ok()) promises_.CheckQuarantines(*records);
    return records;
  }
  absl::Status SetWarning(uint64_t job_id, const std::string& warning) override {
    return store_->SetWarning(job_id, warning);
  }
  absl::StatusOr<std::vector<PartRow>> FindPartsOf(const std::string& identity) override {
    return store_->FindPartsOf(identity);
  }
  // Farms of the simulation keep everything, unless parts exceed their limit.
  absl::Status ChangeJob(uint64_t job_id, const coordinator::JobChange& change) override {
    absl::Status status = store_->ChangeJob(job_id, change);
    if (change.paused) promises_.Paused(job_id, *change.paused, Certain(status));
    if (change.priority) promises_.Prioritized(job_id, *change.priority, Certain(status));
    return status;
  }
  absl::Status ReleaseJob(uint64_t job_id) override { return store_->ReleaseJob(job_id); }
  absl::Status AppendEvents(const std::vector<coordinator::JobEvent>& events) override {
    return store_->AppendEvents(events);
  }
  absl::StatusOr<std::vector<coordinator::JobEvent>> LoadEvents(uint64_t job_id) override {
    return store_->LoadEvents(job_id);
  }
  absl::Status WriteDrains(const std::vector<coordinator::DrainRecord>& records) override {
    return store_->WriteDrains(records);
  }
  absl::Status RemoveDrains(const std::vector<std::string>& worker_ids) override {
    return store_->RemoveDrains(worker_ids);
  }
  absl::StatusOr<std::vector<coordinator::DrainRecord>> LoadDrains() override {
    return store_->LoadDrains();
  }
  absl::StatusOr<std::map<uint64_t, uint64_t>> PartsBytesByJob() override {
    return store_->PartsBytesByJob();
  }
  absl::Status RemoveJob(uint64_t job_id) override { return store_->RemoveJob(job_id); }
  absl::Status WritePart(const PartRow& row, const std::string& bytes) override {
    absl::Status status = store_->WritePart(row, bytes);
    if (!absl::IsAlreadyExists(status)) promises_.Written(row, Certain(status));
    return status;
  }
  std::vector<absl::Status> WriteParts(std::span<const NewPart> parts) override {
    std::vector<absl::Status> statuses = store_->WriteParts(parts);
    for (size_t i = 0; i < parts.size(); ++i) {
      if (!absl::IsAlreadyExists(statuses[i])) {
        promises_.Written(*parts[i].row, Certain(statuses[i]));
      }
    }
    return statuses;
  }
  absl::Status AddStoredPart(const PartRow& row, const std::string& bytes) override {
    absl::Status status = store_->AddStoredPart(row, bytes);
    if (!absl::IsAlreadyExists(status)) promises_.Written(row, Certain(status));
    return status;
  }
  std::optional<PutTicket> TicketFor(const PartRow& row) override { return store_->TicketFor(row); }
  absl::StatusOr<std::optional<PartRow>> FindPart(const coordinator::PartKey& key) override {
    return store_->FindPart(key);
  }
  absl::StatusOr<std::vector<PartRow>> FindTileParts(const FrameId& frame, const PixelRect& tile,
                                                     TaskKind kind) override {
    return store_->FindTileParts(frame, tile, kind);
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
    absl::Status status = store_->RemovePart(row);
    promises_.Removed(row, Certain(status));
    return status;
  }
  absl::Status RemoveFrameParts(const FrameId& frame) override {
    absl::Status status = store_->RemoveFrameParts(frame);
    promises_.FrameRemoved(frame, Certain(status));
    return status;
  }
  absl::StatusOr<std::string> OutputPath(const FrameId& frame) override {
    return store_->OutputPath(frame);
  }
  absl::Status DeliverFrame(const FrameId& frame,
                            const coordinator::DeliveredFrame& delivered) override {
    absl::Status status = store_->DeliverFrame(frame, delivered);
    promises_.Delivered(frame, delivered.image_digest, Certain(status));
    return status;
  }
  void NoteUsage(const UsageOf& of, const coordinator::Usage& usage) override {
    store_->NoteUsage(of, usage);
  }
  absl::Status WriteUsage() override { return store_->WriteUsage(); }
  absl::StatusOr<std::vector<coordinator::UsageRow>> LoadUsage(
      const coordinator::UsageQuery& query) override {
    return store_->LoadUsage(query);
  }
  absl::Status AddRound(const FrameId& frame, const coordinator::RoundRecord& round) override {
    return store_->AddRound(frame, round);
  }
  absl::StatusOr<std::vector<coordinator::StoredRound>> LoadRounds(uint64_t job_id,
                                                                   bool with_cells) override {
    return store_->LoadRounds(job_id, with_cells);
  }
  absl::StatusOr<std::vector<coordinator::RoundRecord>> LoadFrameRounds(
      const FrameId& frame) override {
    return store_->LoadFrameRounds(frame);
  }
  absl::Status ReopenJob(uint64_t job_id, const std::vector<ReopenedFrame>& frames) override {
    absl::Status status = store_->ReopenJob(job_id, frames);
    std::vector<int32_t> numbers;
    for (const ReopenedFrame& frame : frames) numbers.push_back(frame.spec.frame_number);
    promises_.Reopened(job_id, numbers, Certain(status));
    return status;
  }
  absl::StatusOr<std::optional<FrameId>> OldestDeliveredWithParts() override {
    return store_->OldestDeliveredWithParts();
  }
  absl::Status Probe() override { return store_->Probe(); }
  uint64_t PartsBytes() const override { return store_->PartsBytes(); }
  uint64_t FirstLeaseId() const override { return store_->FirstLeaseId(); }
  int64_t LostCommits() const override { return store_->LostCommits(); }

 private:
  bool Certain(const absl::Status& status = absl::OkStatus()) const {
    return status.ok() && !machine_.disk().stopped();
  }

  const std::unique_ptr<coordinator::SqlJobStore> store_;
  Machine& machine_;
  Promises& promises_;
};

}  // namespace sheaf::sim
