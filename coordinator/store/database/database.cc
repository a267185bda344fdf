// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
#include "coordinator/store/database/database.h"

namespace sheaf::coordinator {

int Statement::NextParameter() {
  if (stepped_) {
    prepared_->Reset();
    prepared_->ClearParameters();
    bound_count_ = 0;
    stepped_ = false;
  }
  return ++bound_count_;
}

Statement& Statement::Bind(int64_t value) {
  prepared_->BindInt64(NextParameter(), value);
  return *this;
}

Statement& Statement::Bind(double value) {
  prepared_->BindDouble(NextParameter(), value);
  return *this;
}

Statement& Statement::Bind(const std::string& value) {
  prepared_->BindText(NextParameter(), value);
  return *this;
}

Statement& Statement::BindBytes(std::string_view bytes) {
  prepared_->BindBytes(NextParameter(), bytes);
  return *this;
}

absl::StatusOr<bool> Statement::Step() {
  stepped_ = true;
  absl::StatusOr<bool> row = prepared_->Step();
  if (!row.ok()) prepared_->Reset();
  return row;
}

absl::Status Statement::Run() {
  while (true) {
    const absl::StatusOr<bool> row = Step();
    if (!row.ok()) return row.status();
    if (!*row) break;
  }
  prepared_->Reset();
  return absl::OkStatus();
}

absl::Status Database::InTransaction(const std::function<absl::Status()>& body) {
  absl::Status status = Begin();
  if (!status.ok()) return status;
  status = body();
  if (status.ok()) status = Commit();
  if (!status.ok()) Rollback();
  return status;
}

}  // namespace sheaf::coordinator
