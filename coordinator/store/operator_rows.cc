// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/operator_rows.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator::rows {

absl::Status WriteQuarantine(const QuarantineRecord& record, Database* database) {
  Statement insert = database->Prepare(ReplaceIn<QuarantineRecord>("quarantines", "identity"));
  return BindRow(record, &insert).Run();
}

absl::Status RemoveQuarantine(const std::string& identity, Database* database) {
  return database->Prepare("DELETE FROM quarantines WHERE identity = ?").Bind(identity).Run();
}

absl::StatusOr<std::vector<QuarantineRecord>> LoadQuarantines(Database* database) {
  Statement query = database->Prepare(
      absl::StrCat(SelectFrom<QuarantineRecord>("quarantines"), "ORDER BY time_ns"));
  std::vector<QuarantineRecord> records;
  absl::Status read = ReadRows<QuarantineRecord>(&query, [&records](QuarantineRecord record) {
    records.push_back(std::move(record));
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  return records;
}

absl::Status WriteShare(const ShareSubject& subject, const ShareSetting& setting,
                        Database* database) {
  Statement insert = database->Prepare(ReplaceIn<ShareRow>("shares", "kind, name"));
  return BindRow(ShareRow{subject, setting}, &insert).Run();
}

absl::Status RemoveShare(const ShareSubject& subject, Database* database) {
  return database->Prepare("DELETE FROM shares WHERE kind = ? AND name = ?")
      .Bind(static_cast<int32_t>(subject.kind))
      .Bind(subject.name)
      .Run();
}

absl::StatusOr<std::map<ShareSubject, ShareSetting>> LoadShares(Database* database) {
  Statement query = database->Prepare(SelectFrom<ShareRow>("shares"));
  std::map<ShareSubject, ShareSetting> shares;
  absl::Status read = ReadRows<ShareRow>(&query, [&shares](const ShareRow& row) {
    // A row that is damaged on disk counts as not set.
    if (CheckShareSetting(row.subject, row.setting).ok()) shares[row.subject] = row.setting;
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  return shares;
}

absl::Status WriteDrains(const std::vector<DrainRecord>& records, Database* database) {
  return database->InTransaction([&]() -> absl::Status {
    Statement insert = database->Prepare(ReplaceIn<DrainRecord>("drains", "worker_id"));
    for (const DrainRecord& record : records) {
      if (absl::Status status = BindRow(record, &insert).Run(); !status.ok()) return status;
    }
    return absl::OkStatus();
  });
}

absl::Status RemoveDrains(const std::vector<std::string>& worker_ids, Database* database) {
  return database->InTransaction([&]() -> absl::Status {
    Statement remove = database->Prepare("DELETE FROM drains WHERE worker_id = ?");
    for (const std::string& id : worker_ids) {
      if (absl::Status status = remove.Bind(id).Run(); !status.ok()) return status;
    }
    return absl::OkStatus();
  });
}

absl::StatusOr<std::vector<DrainRecord>> LoadDrains(Database* database) {
  Statement query =
      database->Prepare(absl::StrCat(SelectFrom<DrainRecord>("drains"), "ORDER BY worker_id"));
  std::vector<DrainRecord> records;
  absl::Status read = ReadRows<DrainRecord>(&query, [&records](DrainRecord record) {
    records.push_back(std::move(record));
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  return records;
}

}  // namespace sheaf::coordinator::rows
