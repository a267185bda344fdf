// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqliteJobStore that keeps the leases that came to nothing, for people to look at.
#include "coordinator/store/sqlite_job_store.h"
#include "coordinator/store/stored_times.h"

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
    SqliteStatement insert = database_->Prepare(
        "INSERT INTO failures(job_id, position, frame_number, x0, y0, x1, y1, first, count, "
        "worker_id, kind, message, time_ns) VALUES(?,?,?,?,?,?,?,?,?,?,?,?,?)");
    int64_t position = 0;
    for (const FailureRecord& failure : failures.last) {
      status = insert.Bind(job_id)
                   .Bind(position++)
                   .Bind(failure.frame_number)
                   .Bind(failure.tile.x0)
                   .Bind(failure.tile.y0)
                   .Bind(failure.tile.x1)
                   .Bind(failure.tile.y1)
                   .Bind(failure.block.first)
                   .Bind(failure.block.count)
                   .Bind(failure.worker_id)
                   .Bind(static_cast<int32_t>(failure.kind))
                   .Bind(failure.message)
                   .Bind(ToNanoseconds(failure.time))
                   .Run();
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  });
}

absl::Status SqliteJobStore::LoadFailures(std::vector<StoredJob>* jobs) {
  return ReadRowsOfJobs(
      database_->Prepare(
          "SELECT job_id, frame_number, x0, y0, x1, y1, first, count, worker_id, kind, message, "
          "time_ns FROM failures ORDER BY job_id, position"),
      jobs, [](SqliteStatement* row, StoredJob* job) {
        const auto number = [&](int column) { return static_cast<int32_t>(row->Int64(column)); };
        const auto index = [&](int column) { return static_cast<uint64_t>(row->Int64(column)); };
        job->failures.last.push_back({number(1),
                                      {number(2), number(3), number(4), number(5)},
                                      {index(6), index(7)},
                                      row->Text(8),
                                      static_cast<FailureKind>(number(9)),
                                      row->Text(10),
                                      FromNanoseconds(row->Int64(11))});
      });
}

}  // namespace sheaf::coordinator
