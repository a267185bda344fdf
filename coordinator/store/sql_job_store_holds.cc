// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqlJobStore that stores held work (job_holds.h).
#include <utility>

#include "absl/strings/str_cat.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator {

absl::Status SqlJobStore::InsertHolds(uint64_t job_id, const JobSpec& spec) {
  Statement dependency =
      database_->Prepare(absl::StrCat("INSERT ", IntoTable<DependencyRow>("dependencies")));
  for (const JobDependency& each : spec.dependencies) {
    absl::Status status = BindRow(DependencyRow{job_id, each}, &dependency).Run();
    if (!status.ok()) return status;
  }
  Statement approval =
      database_->Prepare(absl::StrCat("INSERT ", IntoTable<Sealed<ApprovalRow>>("approvals")));
  for (const auto& [number, each] : spec.approvals) {
    absl::Status status = BindRow(Seal(ApprovalRow{job_id, number, each}), &approval).Run();
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status SqlJobStore::LoadHolds(const std::map<uint64_t, StoredJob*>& jobs) {
  Statement dependencies = database_->Prepare(
      absl::StrCat(SelectFrom<DependencyRow>("dependencies"), "ORDER BY job_id, on_job_id"));
  absl::Status read = ReadRows<DependencyRow>(&dependencies, [&jobs](const DependencyRow& row) {
    const auto job = jobs.find(row.job_id);
    if (job != jobs.end()) job->second->spec.dependencies.push_back(row.dependency);
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  Statement approvals = database_->Prepare(SelectFrom<Sealed<ApprovalRow>>("approvals"));
  return ReadRows<Sealed<ApprovalRow>>(&approvals, [&jobs](const Sealed<ApprovalRow>& sealed) {
    const ApprovalRow& row = sealed.row;
    const auto job = jobs.find(row.job_id);
    if (job == jobs.end()) return absl::OkStatus();
    job->second->spec.approvals[row.frame_number] = row.approval;
    if (!sealed.IsWhole()) {
      job->second->damage = absl::StrCat("the row of the approval of frame ", row.frame_number);
    }
    return absl::OkStatus();
  });
}

absl::Status SqlJobStore::NoteApproval(const FrameId& frame, uint64_t samples) {
  Statement update =
      database_->Prepare(absl::StrCat(UpdateOf<Sealed<ApprovalRow>>("approvals"),
                                      "WHERE job_id = ? AND frame_number = ? AND samples <= ?"));
  const ApprovalRow row{frame.job_id, frame.frame_number, {samples, /*approved=*/true}};
  return BindRow(Seal(row), &update)
      .Bind(frame.job_id)
      .Bind(frame.frame_number)
      .Bind(samples)
      .Run();
}

absl::Status SqlJobStore::RemoveHolds(uint64_t job_id) {
  // Only a delivered job may be removed while others wait for it.
  absl::Status status =
      database_->Prepare("UPDATE dependencies SET removed = 1 WHERE on_job_id = ?")
          .Bind(job_id)
          .Run();
  for (const char* table : {"dependencies", "approvals"}) {
    if (!status.ok()) return status;
    status = database_->Prepare(absl::StrCat("DELETE FROM ", table, " WHERE job_id = ?"))
                 .Bind(job_id)
                 .Run();
  }
  return status;
}

absl::Status SqlJobStore::ReleaseJob(uint64_t job_id) {
  const MutexLock lock(&database_mutex_);
  return database_->Prepare("UPDATE dependencies SET released = 1 WHERE job_id = ?")
      .Bind(job_id)
      .Run();
}

absl::Status SqlJobStore::WriteDrains(const std::vector<DrainRecord>& records) {
  const MutexLock lock(&database_mutex_);
  return InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) -> absl::Status {
    Statement insert = database_->Prepare(ReplaceIn<DrainRecord>("drains", "worker_id"));
    for (const DrainRecord& record : records) {
      if (absl::Status status = BindRow(record, &insert).Run(); !status.ok()) return status;
    }
    return absl::OkStatus();
  });
}

absl::Status SqlJobStore::RemoveDrains(const std::vector<std::string>& worker_ids) {
  const MutexLock lock(&database_mutex_);
  return InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) -> absl::Status {
    Statement remove = database_->Prepare("DELETE FROM drains WHERE worker_id = ?");
    for (const std::string& id : worker_ids) {
      if (absl::Status status = remove.Bind(id).Run(); !status.ok()) return status;
    }
    return absl::OkStatus();
  });
}

absl::StatusOr<std::vector<DrainRecord>> SqlJobStore::LoadDrains() {
  const MutexLock lock(&database_mutex_);
  Statement query =
      database_->Prepare(absl::StrCat(SelectFrom<DrainRecord>("drains"), "ORDER BY worker_id"));
  std::vector<DrainRecord> records;
  absl::Status read = ReadRows<DrainRecord>(&query, [&records](DrainRecord record) {
    records.push_back(std::move(record));
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  return records;
}

}  // namespace sheaf::coordinator
