// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/usage_rows.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/time/clock.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator::rows {
namespace {

// "result_count = usage.result_count + excluded.result_count, ...".
std::string SumsOfColumns() {
  std::vector<std::string> sums;
  for (const std::string& name : ColumnsOf<Usage>()) {
    sums.push_back(absl::StrCat(name, " = usage.", name, " + excluded.", name));
  }
  return absl::StrJoin(sums, ", ");
}

}  // namespace

absl::Status AddUsage(const JobStore::UsageOf& of, const Usage& usage, Database* database) {
  const std::vector<std::string> names = ColumnsOf<Usage>();
  const std::vector<std::string> marks(names.size(), "?");
  // Pilots are many and short: they share a row. Nothing is added for a job that does not exist.
  Statement insert = database->Prepare(absl::StrCat(
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

absl::Status RemoveOldUsage(Database* database) {
  return database->Prepare("DELETE FROM usage WHERE day < ?")
      .Bind(UsageDayOf(absl::Now()) - kUsageDaysKept)
      .Run();
}

absl::StatusOr<std::vector<UsageRow>> LoadUsage(const UsageQuery& query, Database* database) {
  Statement select = database->Prepare(absl::StrCat(
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

}  // namespace sheaf::coordinator::rows
