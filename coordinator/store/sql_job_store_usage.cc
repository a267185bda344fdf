// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqlJobStore that keeps the accounts. The usage of parts is added in the transaction
// of their rows: it costs no extra commit, and the two always agree.
#include <map>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator {
namespace {

// "result_count = usage.result_count + excluded.result_count, ...".
std::string SumsOfColumns() {
  std::vector<std::string> sums;
  for (const std::string& name : ColumnsOf<Usage>()) {
    sums.push_back(absl::StrCat(name, " = usage.", name, " + excluded.", name));
  }
  return absl::StrJoin(sums, ", ");
}

Usage UsageOfPart(const PartRow& row) {
  return {.result_count = 1,
          .sample_count = row.sample_count,
          .ray_count = row.cost.ray_count,
          .cpu_duration = row.cost.cpu_duration,
          .part_bytes = row.digest.size_bytes};
}

}  // namespace

absl::Status SqlJobStore::AddUsage(const UsageOf& of, const Usage& usage) {
  const std::vector<std::string> names = ColumnsOf<Usage>();
  const std::vector<std::string> marks(names.size(), "?");
  // Pilots are many and short: they share a row. Nothing is added for a job that does not exist.
  Statement insert = database_->Prepare(absl::StrCat(
      "INSERT INTO usage(day, owner, show, job_id, ", absl::StrJoin(names, ", "), ") SELECT ?, ",
      of.job_id == 0 ? "?, '', 0, " : "owner, show, CASE WHEN job_id < ? THEN job_id ELSE ? END, ",
      absl::StrJoin(marks, ", "), of.job_id == 0 ? " WHERE true" : " FROM jobs WHERE job_id = ?",
      " ON CONFLICT(day, owner, show, job_id) DO UPDATE SET ", SumsOfColumns()));
  insert.Bind(UsageDayOf(absl::Now()));
  of.job_id == 0 ? insert.Bind(of.owner) : insert.Bind(kFirstPilotId).Bind(kFirstPilotId);
  BindRow(usage, &insert);
  if (of.job_id != 0) insert.Bind(of.job_id);
  return insert.Run();
}

absl::Status SqlJobStore::AddUsageOf(const std::vector<PendingPart*>& parts) {
  std::map<uint64_t, Usage> by_job;
  for (const PendingPart* pending : parts) {
    if (!pending->status.ok()) continue;  // Its key has a row already.
    by_job[pending->row->key.frame.job_id] += UsageOfPart(*pending->row);
  }
  for (const auto& [job_id, usage] : by_job) {
    if (absl::Status status = AddUsage({job_id}, usage); !status.ok()) return status;
  }
  return absl::OkStatus();
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
  absl::Status written = InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
    for (const auto& [of, usage] : taken) {
      if (absl::Status status = AddUsage(of, usage); !status.ok()) return status;
    }
    return database_->Prepare("DELETE FROM usage WHERE day < ?")
        .Bind(UsageDayOf(absl::Now()) - kUsageDaysKept)
        .Run();
  });
  if (written.ok()) return written;
  const MutexLock returning(&usage_mutex_);
  for (const auto& [of, usage] : taken) waiting_usage_[of] += usage;
  return written;
}

absl::StatusOr<std::vector<UsageRow>> SqlJobStore::LoadUsage(const UsageQuery& query) {
  if (absl::Status written = WriteUsage(); !written.ok()) return written;
  const MutexLock lock(&database_mutex_);
  Statement select = database_->Prepare(absl::StrCat(
      SelectFrom<UsageRow>("usage"), "WHERE day BETWEEN ? AND ? AND (? = '' OR owner = ?) ",
      "ORDER BY day, owner, show, job_id"));
  select.Bind(query.since_day).Bind(query.until_day).Bind(query.owner).Bind(query.owner);
  std::vector<UsageRow> rows;
  absl::Status read = ReadRows<UsageRow>(&select, [&rows](UsageRow row) {
    rows.push_back(std::move(row));
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  return rows;
}

}  // namespace sheaf::coordinator
