// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqlJobStore that changes the state of jobs. Each change seals the state again.
#include "absl/strings/str_cat.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/stored_rows.h"
#include "coordinator/store/stored_times.h"

namespace sheaf::coordinator {

absl::Status SqlJobStore::SealState(uint64_t job_id) {
  Statement query =
      database_->Prepare(absl::StrCat(SelectFrom<JobRow>("jobs"), "WHERE job_id = ?"));
  query.Bind(job_id);
  int64_t seal = kNoSeal;
  absl::Status status = ReadRows<JobRow>(&query, [&seal](JobRow row) {
    seal = SealOfState(row.job);
    return absl::OkStatus();
  });
  if (!status.ok()) return status;
  return database_->Prepare("UPDATE jobs SET state_seal = ? WHERE job_id = ?")
      .Bind(seal)
      .Bind(job_id)
      .Run();
}

absl::Status SqlJobStore::ChangeState(uint64_t job_id, Statement* update) {
  return InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
    absl::Status status = update->Bind(job_id).Run();
    return status.ok() ? SealState(job_id) : status;
  });
}

absl::Status SqlJobStore::EndJob(uint64_t job_id, JobPhase phase, const std::string& failure,
                                 absl::Time end_time, absl::Duration wall) {
  const MutexLock lock(&database_mutex_);
  Statement update = database_->Prepare(
      "UPDATE jobs SET phase = ?, failure = ?, end_ns = ?, wall_ns = ?, paused = 0 "
      "WHERE job_id = ?");
  update.Bind(static_cast<int32_t>(phase))
      .Bind(failure)
      .Bind(ToNanoseconds(end_time))
      .Bind(ToNanoseconds(wall));
  return ChangeState(job_id, &update);
}

absl::Status SqlJobStore::SetPaused(uint64_t job_id, bool paused) {
  const MutexLock lock(&database_mutex_);
  Statement update = database_->Prepare("UPDATE jobs SET paused = ? WHERE job_id = ?");
  return ChangeState(job_id, &update.Bind(paused ? 1 : 0));
}

absl::Status SqlJobStore::SetPriority(uint64_t job_id, int32_t priority) {
  const MutexLock lock(&database_mutex_);
  Statement update = database_->Prepare("UPDATE jobs SET priority = ? WHERE job_id = ?");
  return ChangeState(job_id, &update.Bind(priority));
}

absl::Status SqlJobStore::SetPinned(uint64_t job_id, bool pinned) {
  const MutexLock lock(&database_mutex_);
  Statement update = database_->Prepare("UPDATE jobs SET pinned = ? WHERE job_id = ?");
  return ChangeState(job_id, &update.Bind(pinned ? 1 : 0));
}

absl::Status SqlJobStore::NotePartsRemoved(uint64_t job_id, absl::Time time) {
  const MutexLock lock(&database_mutex_);
  Statement update = database_->Prepare("UPDATE jobs SET parts_removed_ns = ? WHERE job_id = ?");
  return ChangeState(job_id, &update.Bind(ToNanoseconds(time)));
}

}  // namespace sheaf::coordinator
