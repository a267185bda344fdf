// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The calls of SqlJobStore that read or change rows alone: each locks the database for functions of
// rows (job_rows.h and so on), which are without locks.
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/file.h"
#include "coordinator/store/failure_rows.h"
#include "coordinator/store/hold_rows.h"
#include "coordinator/store/job_rows.h"
#include "coordinator/store/operator_rows.h"
#include "coordinator/store/part_rows.h"
#include "coordinator/store/round_rows.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/usage_rows.h"

namespace sheaf::coordinator {

absl::StatusOr<std::vector<StoredJob>> SqlJobStore::LoadJobs() {
  const MutexLock lock(&database_mutex_);
  absl::StatusOr<std::vector<StoredJob>> jobs = rows::LoadJobs(database_.get());
  if (!jobs.ok()) return Explained(jobs.status());
  return jobs;
}

absl::StatusOr<JobStore::CreatedJob> SqlJobStore::CreateJob(const JobSpec& spec,
                                                            const std::string& request_id,
                                                            absl::Time create_time) {
  const absl::StatusOr<std::optional<uint64_t>> existing = FindRequest(request_id);
  if (!existing.ok()) return existing.status();
  if (existing->has_value()) return CreatedJob{**existing, false};
  const MutexLock lock(&database_mutex_);
  absl::StatusOr<CreatedJob> created;
  absl::Status status =
      database_->InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
        created = rows::InsertJob(spec, request_id, create_time,
                                  spec.pilot ? next_pilot_id_ : next_job_id_, database_.get());
        return created.status();
      });
  if (!status.ok()) return status;
  return created;
}

absl::StatusOr<std::optional<uint64_t>> SqlJobStore::FindRequest(const std::string& request_id) {
  const MutexLock lock(&database_mutex_);
  return rows::FindRequest(request_id, database_.get());
}

absl::Status SqlJobStore::EndJob(uint64_t job_id, JobPhase phase, const std::string& failure,
                                 absl::Time end_time, absl::Duration wall) {
  const MutexLock lock(&database_mutex_);
  return rows::EndJob(job_id, phase, failure, end_time, wall, database_.get());
}

absl::Status SqlJobStore::WriteFailures(uint64_t job_id, const FailureLog& failures) {
  const MutexLock lock(&database_mutex_);
  return rows::WriteFailures(job_id, failures, database_.get());
}

absl::StatusOr<std::vector<TaskTrouble>> SqlJobStore::LoadTroubles(uint64_t job_id) {
  const MutexLock lock(&database_mutex_);
  return rows::LoadTroubles(job_id, database_.get());
}

absl::Status SqlJobStore::WriteQuarantine(const QuarantineRecord& record) {
  const MutexLock lock(&database_mutex_);
  return rows::WriteQuarantine(record, database_.get());
}

absl::Status SqlJobStore::RemoveQuarantine(const std::string& identity) {
  const MutexLock lock(&database_mutex_);
  return rows::RemoveQuarantine(identity, database_.get());
}

absl::StatusOr<std::vector<QuarantineRecord>> SqlJobStore::LoadQuarantines() {
  const MutexLock lock(&database_mutex_);
  return rows::LoadQuarantines(database_.get());
}

absl::Status SqlJobStore::WriteShare(const ShareSubject& subject, const ShareSetting& setting) {
  const MutexLock lock(&database_mutex_);
  return rows::WriteShare(subject, setting, database_.get());
}

absl::Status SqlJobStore::RemoveShare(const ShareSubject& subject) {
  const MutexLock lock(&database_mutex_);
  return rows::RemoveShare(subject, database_.get());
}

absl::StatusOr<std::map<ShareSubject, ShareSetting>> SqlJobStore::LoadShares() {
  const MutexLock lock(&database_mutex_);
  return rows::LoadShares(database_.get());
}

absl::Status SqlJobStore::SetWarning(uint64_t job_id, const std::string& warning) {
  const MutexLock lock(&database_mutex_);
  return rows::SetWarning(job_id, warning, database_.get());
}

absl::StatusOr<std::vector<PartRow>> SqlJobStore::FindPartsOf(const std::string& identity) {
  const MutexLock lock(&database_mutex_);
  return rows::FindPartsOf(identity, database_.get());
}

absl::Status SqlJobStore::ChangeJob(uint64_t job_id, const JobChange& change) {
  const MutexLock lock(&database_mutex_);
  return rows::ChangeJob(job_id, change, database_.get());
}

absl::Status SqlJobStore::ReleaseJob(uint64_t job_id) {
  const MutexLock lock(&database_mutex_);
  return rows::ReleaseJob(job_id, database_.get());
}

absl::Status SqlJobStore::AppendEvents(const std::vector<JobEvent>& events) {
  const MutexLock lock(&database_mutex_);
  return rows::AppendEvents(events, database_.get());
}

absl::StatusOr<std::vector<JobEvent>> SqlJobStore::LoadEvents(uint64_t job_id) {
  const MutexLock lock(&database_mutex_);
  return rows::LoadEvents(job_id, database_.get());
}

absl::Status SqlJobStore::WriteDrains(const std::vector<DrainRecord>& records) {
  const MutexLock lock(&database_mutex_);
  return rows::WriteDrains(records, database_.get());
}

absl::Status SqlJobStore::RemoveDrains(const std::vector<std::string>& worker_ids) {
  const MutexLock lock(&database_mutex_);
  return rows::RemoveDrains(worker_ids, database_.get());
}

absl::StatusOr<std::vector<DrainRecord>> SqlJobStore::LoadDrains() {
  const MutexLock lock(&database_mutex_);
  return rows::LoadDrains(database_.get());
}

absl::StatusOr<std::map<uint64_t, uint64_t>> SqlJobStore::PartsBytesByJob() {
  const MutexLock lock(&database_mutex_);
  return rows::PartsBytesByJob(database_.get());
}

absl::StatusOr<std::optional<PartRow>> SqlJobStore::FindPart(const PartKey& key) {
  const MutexLock lock(&database_mutex_);
  return rows::FindPart(key, database_.get());
}

absl::StatusOr<std::vector<PartRow>> SqlJobStore::FindTileParts(const FrameId& frame,
                                                                const PixelRect& tile,
                                                                TaskKind kind) {
  const MutexLock lock(&database_mutex_);
  return rows::FindTileParts(frame, tile, kind, database_.get());
}

absl::StatusOr<std::vector<PartRow>> SqlJobStore::ListParts(uint64_t job_id) {
  const MutexLock lock(&database_mutex_);
  return rows::ListParts(job_id, database_.get());
}

absl::StatusOr<std::vector<JobStore::TileCost>> SqlJobStore::TileCosts(const FrameId& frame) {
  const MutexLock lock(&database_mutex_);
  return rows::TileCosts(frame, database_.get());
}

absl::StatusOr<std::vector<RoundRecord>> SqlJobStore::LoadFrameRounds(const FrameId& frame) {
  const MutexLock lock(&database_mutex_);
  return rows::LoadFrameRounds(frame, database_.get());
}

absl::Status SqlJobStore::ReopenJob(uint64_t job_id, const std::vector<ReopenedFrame>& frames) {
  const MutexLock lock(&database_mutex_);
  return rows::ReopenJob(job_id, frames, database_.get());
}

absl::StatusOr<std::optional<FrameId>> SqlJobStore::OldestDeliveredWithParts() {
  const MutexLock lock(&database_mutex_);
  return rows::OldestDeliveredWithParts(database_.get());
}

absl::StatusOr<std::string> SqlJobStore::OutputPath(const FrameId& frame) {
  const std::string directory = absl::StrCat(directory_, "/outputs/", frame.job_id);
  if (absl::Status status = MakeDirectories(directory); !status.ok()) return status;
  return absl::StrCat(directory, "/", frame.frame_number, ".exr");
}

absl::Status SqlJobStore::DeliverFrame(const FrameId& frame, const DeliveredFrame& delivered) {
  std::error_code error;
  const std::string path =
      absl::StrCat(directory_, "/outputs/", frame.job_id, "/", frame.frame_number, ".exr");
  const uintmax_t image_bytes = std::filesystem::file_size(path, error);
  const MutexLock lock(&database_mutex_);
  return database_->InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
    absl::Status status = rows::DeliverFrame(frame, delivered, database_.get());
    if (!status.ok()) return status;
    return rows::AddUsage({frame.job_id}, {.image_bytes = error ? 0 : image_bytes},
                          database_.get());
  });
}

absl::Status SqlJobStore::WriteTroubles(const std::vector<TaskTrouble>& troubles) {
  if (troubles.empty()) return absl::OkStatus();
  const MutexLock lock(&database_mutex_);
  return rows::WriteTroubles(troubles, database_.get());
}

absl::Status SqlJobStore::AddRound(const FrameId& frame, const RoundRecord& round) {
  const MutexLock lock(&database_mutex_);
  return rows::InsertRound(frame, round, database_.get());
}

absl::StatusOr<std::vector<StoredRound>> SqlJobStore::LoadRounds(uint64_t job_id, bool with_cells) {
  const MutexLock lock(&database_mutex_);
  absl::StatusOr<std::vector<StoredRound>> rounds =
      rows::LoadRounds(job_id, with_cells, database_.get());
  if (!rounds.ok()) return Explained(rounds.status());
  return rounds;
}

void SqlJobStore::NoteUsage(const UsageOf& of, const Usage& usage) {
  const MutexLock lock(&usage_mutex_);
  waiting_usage_[of] += usage;
}

absl::Status SqlJobStore::WriteUsage() {
  const MutexLock lock(&database_mutex_);
  std::map<UsageOf, Usage> taken;
  {
    const MutexLock taking(&usage_mutex_);
    taken.swap(waiting_usage_);
  }
  if (taken.empty()) return absl::OkStatus();
  absl::Status written =
      database_->InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
        for (const auto& [of, usage] : taken) {
          absl::Status status = rows::AddUsage(of, usage, database_.get());
          if (!status.ok()) return status;
        }
        return rows::RemoveOldUsage(database_.get());
      });
  if (written.ok()) return written;
  const MutexLock returning(&usage_mutex_);
  for (const auto& [of, usage] : taken) waiting_usage_[of] += usage;
  return written;
}

absl::StatusOr<std::vector<UsageRow>> SqlJobStore::LoadUsage(const UsageQuery& query) {
  if (absl::Status written = WriteUsage(); !written.ok()) return written;
  const MutexLock lock(&database_mutex_);
  return rows::LoadUsage(query, database_.get());
}

}  // namespace sheaf::coordinator
