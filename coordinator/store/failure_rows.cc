// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/failure_rows.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator::rows {
namespace {

// A row for each worker and class; a last one, without a count, for a task that is set aside.
std::vector<TaskFailure> RowsOf(const TaskTrouble& trouble) {
  std::vector<TaskFailure> rows = trouble.failures;
  if (!trouble.set_aside.empty()) {
    rows.push_back({"", "", FailureKind::kReleased, 0, trouble.set_aside});
  }
  return rows;
}

bool IsSameTask(const TaskTrouble& a, const TaskTrouble& b) {
  return a.frame == b.frame && a.kind == b.kind && a.tile == b.tile && a.block == b.block &&
         a.cells == b.cells;
}

}  // namespace

absl::Status WriteFailures(uint64_t job_id, const FailureLog& failures, Database* database) {
  return database->InTransaction([&]() {
    absl::Status status = database->Prepare("UPDATE jobs SET failure_count = ? WHERE job_id = ?")
                              .Bind(failures.count)
                              .Bind(job_id)
                              .Run();
    if (!status.ok()) return status;
    status = database->Prepare("DELETE FROM failures WHERE job_id = ?").Bind(job_id).Run();
    if (!status.ok()) return status;
    Statement insert =
        database->Prepare(absl::StrCat("INSERT ", IntoTable<FailureRow>("failures")));
    int64_t position = 0;
    for (const FailureRecord& failure : failures.last) {
      status = BindRow(FailureRow{job_id, position++, failure}, &insert).Run();
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  });
}

absl::Status LoadFailures(const std::map<uint64_t, StoredJob*>& jobs, Database* database) {
  Statement query = database->Prepare(
      absl::StrCat(SelectFrom<FailureRow>("failures"), "ORDER BY job_id, position"));
  return ReadRows<FailureRow>(&query, [&jobs](FailureRow row) {
    const auto job = jobs.find(row.job_id);
    if (job != jobs.end()) job->second->failures.last.push_back(std::move(row.failure));
    return absl::OkStatus();
  });
}

absl::Status WriteTroubles(const std::vector<TaskTrouble>& troubles, Database* database) {
  if (troubles.empty()) return absl::OkStatus();
  return database->InTransaction([&]() {
    Statement insert =
        database->Prepare(absl::StrCat("INSERT ", IntoTable<Sealed<TroubleRow>>("task_failures")));
    for (const TaskTrouble& trouble : troubles) {
      absl::Status status =
          database
              ->Prepare(
                  "DELETE FROM task_failures WHERE job_id = ? AND frame_number = ? AND "
                  "task_kind = ? AND y0 = ? AND x0 = ? AND first = ? AND count = ? AND cells = ?")
              .Bind(trouble.frame.job_id)
              .Bind(trouble.frame.frame_number)
              .Bind(StoredForm(trouble.kind))
              .Bind(trouble.tile.y0)
              .Bind(trouble.tile.x0)
              .Bind(trouble.block.first)
              .Bind(trouble.block.count)
              .Bind(trouble.cells.mask)
              .Run();
      if (!status.ok()) return status;
      for (const TaskFailure& failure : RowsOf(trouble)) {
        status = BindRow(Seal(TroubleRow{trouble, failure}), &insert).Run();
        if (!status.ok()) return status;
      }
    }
    return absl::OkStatus();
  });
}

absl::StatusOr<std::vector<TaskTrouble>> LoadTroubles(uint64_t job_id, Database* database) {
  Statement query = database->Prepare(absl::StrCat(
      SelectFrom<Sealed<TroubleRow>>("task_failures"),
      "WHERE job_id = ? ORDER BY frame_number, task_kind, y0, x0, first, count, cells, "
      "worker_id, kind"));
  query.Bind(job_id);
  std::vector<TaskTrouble> troubles;
  absl::Status read = ReadRows<Sealed<TroubleRow>>(&query, [&troubles](Sealed<TroubleRow> sealed) {
    if (!sealed.IsWhole()) return absl::OkStatus();
    TroubleRow& row = sealed.row;
    const bool is_same = !troubles.empty() && IsSameTask(troubles.back(), row.task);
    if (!is_same) troubles.push_back(std::move(row.task));
    if (row.failure.count == 0) {
      troubles.back().set_aside = std::move(row.failure.words);
    } else {
      troubles.back().failures.push_back(std::move(row.failure));
    }
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  return troubles;
}

absl::Status AppendEvents(const std::vector<JobEvent>& events, Database* database) {
  if (events.empty()) return absl::OkStatus();
  return database->InTransaction([&]() {
    Statement insert =
        database->Prepare(absl::StrCat("INSERT ", IntoTable<EventRow>("job_events")));
    Statement last = database->Prepare(
        "SELECT CAST(COALESCE((SELECT MAX(position) FROM job_events WHERE job_id = ?), 0) AS "
        "BIGINT) FROM jobs WHERE job_id = ?");
    Statement trim = database->Prepare("DELETE FROM job_events WHERE job_id = ? AND position <= ?");
    for (const JobEvent& event : events) {
      const absl::StatusOr<bool> job = last.Bind(event.job_id).Bind(event.job_id).Step();
      if (!job.ok()) return job.status();
      if (!*job) continue;
      const int64_t position = last.Int64(0) + 1;
      absl::Status status = BindRow(EventRow{event.job_id, position, event.frame_number.has_value(),
                                             event.frame_number.value_or(0), event},
                                    &insert)
                                .Run();
      if (status.ok()) status = trim.Bind(event.job_id).Bind(position - kJobEventsMax).Run();
      if (!status.ok()) return status;
    }
    return absl::OkStatus();
  });
}

absl::StatusOr<std::vector<JobEvent>> LoadEvents(uint64_t job_id, Database* database) {
  Statement query = database->Prepare(
      absl::StrCat(SelectFrom<EventRow>("job_events"), "WHERE job_id = ? ORDER BY position"));
  query.Bind(job_id);
  std::vector<JobEvent> events;
  absl::Status read = ReadRows<EventRow>(&query, [&events](EventRow row) {
    row.event.job_id = row.job_id;
    if (row.of_frame) row.event.frame_number = row.frame_number;
    events.push_back(std::move(row.event));
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  return events;
}

}  // namespace sheaf::coordinator::rows
