// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqlJobStore that stores operators' settings for users, shows and pools.
#include "absl/strings/str_cat.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator {

absl::Status SqlJobStore::WriteShare(const ShareSubject& subject, const ShareSetting& setting) {
  const MutexLock lock(&database_mutex_);
  Statement insert = database_->Prepare(ReplaceIn<ShareRow>("shares", "kind, name"));
  return BindRow(ShareRow{subject, setting}, &insert).Run();
}

absl::Status SqlJobStore::RemoveShare(const ShareSubject& subject) {
  const MutexLock lock(&database_mutex_);
  return database_->Prepare("DELETE FROM shares WHERE kind = ? AND name = ?")
      .Bind(static_cast<int32_t>(subject.kind))
      .Bind(subject.name)
      .Run();
}

absl::StatusOr<std::map<ShareSubject, ShareSetting>> SqlJobStore::LoadShares() {
  const MutexLock lock(&database_mutex_);
  Statement query = database_->Prepare(SelectFrom<ShareRow>("shares"));
  std::map<ShareSubject, ShareSetting> shares;
  absl::Status read = ReadRows<ShareRow>(&query, [&shares](const ShareRow& row) {
    // A row that is damaged on disk counts as not set.
    if (CheckShareSetting(row.subject, row.setting).ok()) shares[row.subject] = row.setting;
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  return shares;
}

}  // namespace sheaf::coordinator
