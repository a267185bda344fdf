// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqliteJobStore that stores failed leases, for display.
#include <utility>

#include "absl/strings/str_cat.h"
#include "coordinator/store/sqlite_columns.h"
#include "coordinator/store/sqlite_job_store.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator {

absl::Status SqliteJobStore::WriteFailures(uint64_t job_id, const FailureLog& failures) {
  const MutexLock lock(&database_mutex_);
  return InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
    absl::Status status = database_->Prepare("UPDATE jobs SET failure_count = ? WHERE job_id = ?")
                              .Bind(failures.count)
                              .Bind(job_id)
                              .Run();
    if (!status.ok()) return status;
    status = database_->Prepare("DELETE FROM failures WHERE job_id = ?").Bind(job_id).Run();
    if (!status.ok()) return status;
    SqliteStatement insert =
        database_->Prepare(absl::StrCat("INSERT ", IntoTable<FailureRow>("failures")));
    int64_t position = 0;
    for (const FailureRecord& failure : failures.last) {
      status = BindRow(FailureRow{job_id, position++, failure}, &insert).Run();
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  });
}

absl::Status SqliteJobStore::LoadFailures(const std::map<uint64_t, StoredJob*>& jobs) {
  SqliteStatement query = database_->Prepare(
      absl::StrCat(SelectFrom<FailureRow>("failures"), "ORDER BY job_id, position"));
  return ReadRows<FailureRow>(&query, [&jobs](FailureRow row) {
    const auto job = jobs.find(row.job_id);
    if (job != jobs.end()) job->second->failures.last.push_back(std::move(row.failure));
    return absl::OkStatus();
  });
}

}  // namespace sheaf::coordinator
