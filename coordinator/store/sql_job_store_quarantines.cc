// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqlJobStore that stores quarantines, and finds the parts of an identity.
#include <utility>

#include "absl/strings/str_cat.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator {

absl::Status SqlJobStore::WriteQuarantine(const QuarantineRecord& record) {
  const MutexLock lock(&database_mutex_);
  Statement insert = database_->Prepare(ReplaceIn<QuarantineRecord>("quarantines", "identity"));
  return BindRow(record, &insert).Run();
}

absl::Status SqlJobStore::RemoveQuarantine(const std::string& identity) {
  const MutexLock lock(&database_mutex_);
  return database_->Prepare("DELETE FROM quarantines WHERE identity = ?").Bind(identity).Run();
}

absl::StatusOr<std::vector<QuarantineRecord>> SqlJobStore::LoadQuarantines() {
  const MutexLock lock(&database_mutex_);
  Statement query = database_->Prepare(
      absl::StrCat(SelectFrom<QuarantineRecord>("quarantines"), "ORDER BY time_ns"));
  std::vector<QuarantineRecord> records;
  absl::Status read = ReadRows<QuarantineRecord>(&query, [&records](QuarantineRecord record) {
    records.push_back(std::move(record));
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  return records;
}

absl::StatusOr<std::vector<PartRow>> SqlJobStore::FindPartsOf(const std::string& identity) {
  const MutexLock lock(&database_mutex_);
  Statement query = database_->Prepare(
      absl::StrCat(SelectFrom<Sealed<PartRow>>("parts"), "WHERE identity = ? ORDER BY job_id"));
  query.Bind(identity);
  return ReadPartRows(&query);
}

absl::Status SqlJobStore::SetWarning(uint64_t job_id, const std::string& warning) {
  const MutexLock lock(&database_mutex_);
  return database_->Prepare("UPDATE jobs SET warning = ? WHERE job_id = ?")
      .Bind(warning)
      .Bind(job_id)
      .Run();
}

}  // namespace sheaf::coordinator
