// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/hold_rows.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator::rows {

absl::Status InsertHolds(uint64_t job_id, const JobSpec& spec, Database* database) {
  Statement dependency =
      database->Prepare(absl::StrCat("INSERT ", IntoTable<DependencyRow>("dependencies")));
  for (const JobDependency& each : spec.dependencies) {
    absl::Status status = BindRow(DependencyRow{job_id, each}, &dependency).Run();
    if (!status.ok()) return status;
  }
  Statement approval =
      database->Prepare(absl::StrCat("INSERT ", IntoTable<Sealed<ApprovalRow>>("approvals")));
  for (const auto& [number, each] : spec.approvals) {
    absl::Status status = BindRow(Seal(ApprovalRow{job_id, number, each}), &approval).Run();
    if (!status.ok()) return status;
  }
  return absl::OkStatus();
}

absl::Status LoadHolds(const std::map<uint64_t, StoredJob*>& jobs, Database* database) {
  Statement dependencies = database->Prepare(
      absl::StrCat(SelectFrom<DependencyRow>("dependencies"), "ORDER BY job_id, on_job_id"));
  absl::Status read = ReadRows<DependencyRow>(&dependencies, [&jobs](const DependencyRow& row) {
    const auto job = jobs.find(row.job_id);
    if (job != jobs.end()) job->second->spec.dependencies.push_back(row.dependency);
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  Statement approvals = database->Prepare(SelectFrom<Sealed<ApprovalRow>>("approvals"));
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

absl::Status NoteApproval(const FrameId& frame, uint64_t samples, Database* database) {
  Statement update =
      database->Prepare(absl::StrCat(UpdateOf<Sealed<ApprovalRow>>("approvals"),
                                     "WHERE job_id = ? AND frame_number = ? AND samples <= ?"));
  const ApprovalRow row{frame.job_id, frame.frame_number, {samples, /*approved=*/true}};
  return BindRow(Seal(row), &update)
      .Bind(frame.job_id)
      .Bind(frame.frame_number)
      .Bind(samples)
      .Run();
}

absl::Status RemoveHolds(uint64_t job_id, Database* database) {
  // Only a delivered job may be removed while others wait for it.
  absl::Status status = database->Prepare("UPDATE dependencies SET removed = 1 WHERE on_job_id = ?")
                            .Bind(job_id)
                            .Run();
  for (const char* table : {"dependencies", "approvals"}) {
    if (!status.ok()) return status;
    status = database->Prepare(absl::StrCat("DELETE FROM ", table, " WHERE job_id = ?"))
                 .Bind(job_id)
                 .Run();
  }
  return status;
}

absl::Status ReleaseJob(uint64_t job_id, Database* database) {
  return database->Prepare("UPDATE dependencies SET released = 1 WHERE job_id = ?")
      .Bind(job_id)
      .Run();
}

}  // namespace sheaf::coordinator::rows
