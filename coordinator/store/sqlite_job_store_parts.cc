// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqliteJobStore that stores parts: first the bytes, then the row, then the call
// returns OK.
#include <filesystem>
#include <system_error>
#include <utility>

#include "absl/strings/str_cat.h"
#include "common/base/digest.h"
#include "common/base/file.h"
#include "coordinator/store/sqlite_columns.h"
#include "coordinator/store/sqlite_job_store.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator {

absl::Status SqliteJobStore::WritePart(const PartRow& row, const std::string& bytes) {
  // The key is checked first, so that a repeated result does not touch the disk.
  const absl::StatusOr<std::optional<PartRow>> existing = FindPart(row.key);
  if (!existing.ok()) return existing.status();
  if (existing->has_value()) return absl::AlreadyExistsError("the part already exists");
  if (absl::Status s = MakeDirectories(FrameDirectory(row.key.frame)); !s.ok()) return s;
  const std::string path = PartPath(row);
  const auto write = durability_ == Durability::kPowerLoss ? &WriteFileAtomically : &WriteFileOnce;
  if (absl::Status s = write(path, bytes); !s.ok()) return s;
  absl::Status status = CommitRow(row);
  if (status.ok()) {
    parts_bytes_ += bytes.size();
    return status;
  }
  // If two equal parts arrive at the same time, one call finds the other's row, and they share the
  // file.
  if (!absl::IsAlreadyExists(status)) {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
  }
  return status;
}

// The first caller commits the rows of all waiting calls; calls that arrive meanwhile form the next
// commit.
absl::Status SqliteJobStore::CommitRow(const PartRow& row) {
  PendingRow mine;
  mine.row = &row;
  MutexLock lock(&pending_mutex_);
  pending_.push_back(&mine);
  const auto may_act = [this, &mine]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(pending_mutex_) {
    return mine.finished || !committing_;
  };
  while (true) {
    pending_changed_.Wait(&pending_mutex_, may_act);
    if (mine.finished) break;
    committing_ = true;
    const std::vector<PendingRow*> batch(pending_.begin(), pending_.end());
    pending_.clear();
    lock.Unlock();
    CommitPending(batch);
    lock.Lock();
    for (PendingRow* pending : batch) pending->finished = true;
    committing_ = false;
    pending_changed_.NotifyAll();
  }
  return mine.status;
}

void SqliteJobStore::CommitPending(const std::vector<PendingRow*>& rows) {
  const MutexLock lock(&database_mutex_);
  absl::Status shared = database_->Execute("BEGIN IMMEDIATE");
  if (shared.ok()) {
    for (PendingRow* pending : rows) {
      pending->status = InsertRow(*pending->row);
      // A key that exists already affects only its own row. Other errors may have ended the
      // transaction, and later rows would then be inserted outside it.
      if (!pending->status.ok() && !absl::IsAlreadyExists(pending->status)) {
        shared = pending->status;
        break;
      }
    }
    if (shared.ok()) shared = AddUsageOf(rows);
    if (shared.ok()) shared = database_->Execute("COMMIT");
    if (!shared.ok()) database_->Execute("ROLLBACK").IgnoreError();
  }
  if (shared.ok()) return;
  for (PendingRow* pending : rows) pending->status = shared;
}

absl::Status SqliteJobStore::InsertRow(const PartRow& row) {
  SqliteStatement insert =
      database_->Prepare(absl::StrCat("INSERT ", IntoTable<Sealed<PartRow>>("parts")));
  return BindRow(Seal(row), &insert).Run();
}

absl::StatusOr<std::optional<PartRow>> SqliteJobStore::FindPart(const PartKey& key) {
  const MutexLock lock(&database_mutex_);
  SqliteStatement query = database_->Prepare(
      absl::StrCat(SelectFrom<Sealed<PartRow>>("parts"),
                   "WHERE job_id = ? AND frame_number = ? AND y0 = ? AND x0 = ? AND first = ? AND "
                   "count = ? AND cells = ? AND kind = ?"));
  query.Bind(key.frame.job_id)
      .Bind(key.frame.frame_number)
      .Bind(key.tile.y0)
      .Bind(key.tile.x0)
      .Bind(key.block.first)
      .Bind(key.block.count)
      .Bind(key.cells.mask)
      .Bind(StoredForm(key.kind));
  absl::StatusOr<std::vector<PartRow>> rows = ReadPartRows(&query);
  if (!rows.ok()) return rows.status();
  if (rows->empty()) return std::optional<PartRow>();
  return std::optional<PartRow>(std::move(rows->front()));
}

absl::StatusOr<std::vector<PartRow>> SqliteJobStore::FindTileParts(const FrameId& frame,
                                                                   const PixelRect& tile,
                                                                   TaskKind kind) {
  const MutexLock lock(&database_mutex_);
  SqliteStatement query = database_->Prepare(
      absl::StrCat(SelectFrom<Sealed<PartRow>>("parts"),
                   "WHERE job_id = ? AND frame_number = ? AND kind = ? AND y0 = ? AND x0 = ? "
                   "ORDER BY first"));
  query.Bind(frame.job_id)
      .Bind(frame.frame_number)
      .Bind(StoredForm(kind))
      .Bind(tile.y0)
      .Bind(tile.x0);
  return ReadPartRows(&query);
}

absl::StatusOr<std::vector<PartRow>> SqliteJobStore::ListParts(uint64_t job_id) {
  const MutexLock lock(&database_mutex_);
  SqliteStatement query =
      database_->Prepare(absl::StrCat(SelectFrom<Sealed<PartRow>>("parts"), "WHERE job_id = ?"));
  query.Bind(job_id);
  return ReadPartRows(&query);
}

absl::StatusOr<std::vector<JobStore::TileCost>> SqliteJobStore::TileCosts(const FrameId& frame) {
  const MutexLock lock(&database_mutex_);
  SqliteStatement query = database_->Prepare(
      absl::StrCat(SelectFrom<TileCost>("parts"),
                   "WHERE job_id = ? AND frame_number = ? AND kind = ? GROUP BY y0, x0, y1, x1"));
  query.Bind(frame.job_id).Bind(frame.frame_number).Bind(StoredForm(TaskKind::kCamera));
  std::vector<TileCost> costs;
  absl::Status read = ReadRows<TileCost>(&query, [&costs](const TileCost& cost) {
    costs.push_back(cost);
    return absl::OkStatus();
  });
  if (!read.ok()) return read;
  return costs;
}

absl::StatusOr<std::string> SqliteJobStore::ReadPart(const PartRow& row) {
  const std::string path = PartPath(row);
  absl::StatusOr<std::string> bytes = ReadWholeFile(path, row.digest.size_bytes + 1);
  if (!bytes.ok()) return bytes;
  if (bytes->size() != row.digest.size_bytes || Sha256Hex(*bytes) != row.digest.sha256_hex) {
    return absl::DataLossError(path +
                               ": the bytes do not match the digest under which they were stored");
  }
  return bytes;
}

absl::Status SqliteJobStore::RemovePart(const PartRow& row) {
  uint64_t bytes = 0;  // None where the row is gone already.
  {
    const MutexLock lock(&database_mutex_);
    SqliteStatement removal = database_->Prepare(
        "DELETE FROM parts WHERE job_id = ? AND frame_number = ? AND y0 = ? AND x0 = ? "
        "AND first = ? AND count = ? AND cells = ? AND kind = ? RETURNING size_bytes");
    removal.Bind(row.key.frame.job_id)
        .Bind(row.key.frame.frame_number)
        .Bind(row.key.tile.y0)
        .Bind(row.key.tile.x0)
        .Bind(row.key.block.first)
        .Bind(row.key.block.count)
        .Bind(row.key.cells.mask)
        .Bind(StoredForm(row.key.kind));
    while (true) {
      const absl::StatusOr<bool> removed = removal.Step();
      if (!removed.ok()) return removed.status();
      if (!*removed) break;
      bytes = static_cast<uint64_t>(removal.Int64(0));
    }
  }
  parts_bytes_ -= std::min<uint64_t>(bytes, parts_bytes_);
  std::error_code ignored;
  std::filesystem::remove(PartPath(row), ignored);
  return absl::OkStatus();
}

absl::Status SqliteJobStore::RemoveFrameParts(const FrameId& frame) {
  uint64_t bytes = 0;
  {
    const MutexLock lock(&database_mutex_);
    SqliteStatement sum = database_->Prepare(
        "SELECT COALESCE(SUM(size_bytes), 0) FROM parts WHERE job_id = ? AND frame_number = ?");
    const absl::StatusOr<bool> row = sum.Bind(frame.job_id).Bind(frame.frame_number).Step();
    if (!row.ok()) return row.status();
    bytes = static_cast<uint64_t>(sum.Int64(0));
    absl::Status status =
        database_->Prepare("DELETE FROM parts WHERE job_id = ? AND frame_number = ?")
            .Bind(frame.job_id)
            .Bind(frame.frame_number)
            .Run();
    if (!status.ok()) return status;
  }
  parts_bytes_ -= std::min<uint64_t>(bytes, parts_bytes_);
  std::error_code ignored;
  std::filesystem::remove_all(FrameDirectory(frame), ignored);
  std::filesystem::remove(std::filesystem::path(FrameDirectory(frame)).parent_path(), ignored);
  return absl::OkStatus();
}

absl::StatusOr<std::optional<FrameId>> SqliteJobStore::OldestDeliveredWithParts() {
  const MutexLock lock(&database_mutex_);
  SqliteStatement query = database_->Prepare(
      "SELECT parts.job_id, parts.frame_number FROM parts JOIN frames USING(job_id, frame_number) "
      "JOIN jobs USING(job_id) WHERE (delivered = 1 OR phase = ?) AND pinned = 0 "
      "ORDER BY parts.job_id, parts.frame_number LIMIT 1");
  const absl::StatusOr<bool> row = query.Bind(StoredForm(JobPhase::kFailed)).Step();
  if (!row.ok()) return row.status();
  if (!*row) return std::optional<FrameId>();
  return std::optional<FrameId>(
      FrameId{static_cast<uint64_t>(query.Int64(0)), static_cast<int32_t>(query.Int64(1))});
}

}  // namespace sheaf::coordinator
