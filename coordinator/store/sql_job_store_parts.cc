// Copyright the Sheaf authors.
// SPDX-License-Identifier: Apache-2.0
//
// The part of SqlJobStore that stores parts: first the object, then the row, then the call
// returns OK.
#include <algorithm>
#include <array>
#include <set>
#include <span>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "common/base/log.h"
#include "coordinator/store/row_columns.h"
#include "coordinator/store/sql_job_store.h"
#include "coordinator/store/stored_rows.h"

namespace sheaf::coordinator {
namespace {

// The maximum parts of a group: their rows occupy the database for some milliseconds.
constexpr size_t kGroupPartsMax = 1024;
// Numbers of rows that one statement may insert: the first that is at most the number left. Each
// statement is prepared once per connection, so there are few; with the columns of a row they stay
// far below SQLite's 32,766 parameters.
constexpr std::array<size_t, 4> kStatementRows = {128, 32, 8, 2};

absl::Status KeyHasPart() { return absl::AlreadyExistsError("the key has a part already"); }

size_t StatementRows(size_t left) {
  const auto fits = std::ranges::find_if(kStatementRows, [left](size_t n) { return n <= left; });
  return fits == kStatementRows.end() ? 1 : *fits;
}

// Inserts several rows by one statement, because PostgreSQL answers each statement after a round
// trip (docs/adr/0081). Reports for each row whether it is stored; a row whose key has a part is
// not.
// Requires: no two rows are equal.
absl::StatusOr<std::vector<bool>> InsertTogether(std::span<const PartRow* const> rows,
                                                 Database* database) {
  const std::string marks =
      absl::StrJoin(std::vector<std::string>(ColumnsOf<Sealed<PartRow>>().size(), "?"), ",");
  std::string sql = absl::StrCat("INSERT ", IntoTable<Sealed<PartRow>>("parts"));
  for (size_t i = 1; i < rows.size(); ++i) absl::StrAppend(&sql, ",(", marks, ")");
  Statement insert = database->Prepare(absl::StrCat(sql, " ON CONFLICT DO NOTHING RETURNING seal"));
  std::vector<int64_t> seals;
  for (const PartRow* row : rows) {
    const Sealed<PartRow> sealed = Seal(*row);
    seals.push_back(sealed.seal);
    BindRow(sealed, &insert);
  }
  std::set<int64_t> stored;
  while (true) {
    const absl::StatusOr<bool> row = insert.Step();
    if (!row.ok()) return row.status();
    if (!*row) break;
    stored.insert(insert.Int64(0));
  }
  std::vector<bool> is_stored;
  for (const int64_t seal : seals) is_stored.push_back(stored.contains(seal));
  return is_stored;
}

}  // namespace

class SqlJobStore::NameReservation {
 public:
  NameReservation(SqlJobStore* store, std::string name) : store_(*store), name_(std::move(name)) {
    const MutexLock lock(&store_.pending_mutex_);
    const auto is_free = [this]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(store_.pending_mutex_) {
      return !store_.names_.contains(name_);
    };
    store_.name_released_.Wait(&store_.pending_mutex_, is_free);
    store_.names_.insert(name_);
  }
  ~NameReservation() {
    const MutexLock lock(&store_.pending_mutex_);
    store_.names_.erase(name_);
    store_.name_released_.NotifyAll();
  }
  NameReservation(const NameReservation&) = delete;
  NameReservation& operator=(const NameReservation&) = delete;

 private:
  SqlJobStore& store_;
  const std::string name_;
};

absl::Status SqlJobStore::WritePart(const PartRow& row, const std::string& bytes) {
  const NameReservation reservation(this, NameOf(row));
  if (absl::Status written = WriteObject(row, bytes); !written.ok()) return written;
  absl::Status status = CommitPart(row);
  if (status.ok()) {
    parts_bytes_ += bytes.size();
  } else {
    RemoveUnlessAcknowledged(row, status);
  }
  return status;
}

void SqlJobStore::RemoveUnlessAcknowledged(const PartRow& row, const absl::Status& failed) {
  // If coordinators share the store, the object may belong to the one that took over. LoadParts
  // removes it if no row names it.
  if (shared_ && !absl::IsAlreadyExists(failed)) return;
  // A store without conditional writes has replaced the object of an equal part.
  const absl::StatusOr<std::optional<PartRow>> existing = FindPart(row.key);
  if (!existing.ok()) return;
  if (existing->has_value() && (*existing)->digest == row.digest) return;
  parts_->Remove(NameOf(row)).IgnoreError();  // A remaining object has no row.
}

absl::Status SqlJobStore::AddStoredPart(const PartRow& row, const std::string& bytes) {
  const NameReservation reservation(this, NameOf(row));
  const absl::StatusOr<std::optional<PartRow>> existing = FindPart(row.key);
  if (!existing.ok()) return existing.status();
  if (existing->has_value()) return absl::AlreadyExistsError("the part already exists");
  // An earlier part of the same name may have been removed since this one was stored.
  const absl::StatusOr<uint64_t> size_bytes = parts_->Head(NameOf(row));
  const bool is_there = size_bytes.ok() && *size_bytes == row.digest.size_bytes;
  absl::Status status = is_there ? absl::OkStatus() : WriteObject(row, bytes);
  if (status.ok()) status = CommitPart(row);
  if (status.ok()) parts_bytes_ += bytes.size();
  return status;
}

absl::Status SqlJobStore::WriteObject(const PartRow& row, const std::string& bytes) {
  const std::string name = NameOf(row);
  absl::Status status = parts_->Put(name, bytes, PutMode::kIfAbsent);
  if (absl::IsAlreadyExists(status)) {
    // Only an equal part has the same name. The object of one that has a row is not touched;
    // without a row it was never acknowledged.
    const absl::StatusOr<std::optional<PartRow>> existing = FindPart(row.key);
    if (!existing.ok()) return existing.status();
    if (existing->has_value()) return absl::AlreadyExistsError("the part already exists");
    status = parts_->Put(name, bytes, PutMode::kReplace);
  }
  if (!absl::IsPermissionDenied(status) && !absl::IsFailedPrecondition(status)) return status;
  // These codes would tell a worker that its result is refused, or must be sent in another way.
  return absl::UnavailableError(std::string(status.message()));
}

std::optional<PutTicket> SqlJobStore::TicketFor(const PartRow& row) {
  return parts_->TicketToPut(NameOf(row), {row.digest.sha256_hex, row.digest.size_bytes});
}

// The first caller commits the parts of all waiting calls; calls that arrive meanwhile form the
// next group, which the first of them commits. Each call waits only for its own part, so that the
// end of a group does not wake other calls.
absl::Status SqlJobStore::CommitPart(const PartRow& row) {
  PendingPart mine;
  mine.row = &row;
  MutexLock lock(&pending_mutex_);
  pending_.push_back(&mine);
  mine.leads = !std::exchange(committing_, true);
  mine.changed.Wait(&pending_mutex_, [&mine] { return mine.finished || mine.leads; });
  if (mine.finished) return mine.status;
  const auto count = static_cast<int64_t>(std::min(pending_.size(), kGroupPartsMax));
  const std::vector<PendingPart*> group(pending_.begin(), pending_.begin() + count);
  pending_.erase(pending_.begin(), pending_.begin() + count);
  lock.Unlock();
  CommitGroup(group);
  lock.Lock();
  for (PendingPart* part : group) {
    part->finished = true;
    part->changed.NotifyOne();
  }
  committing_ = !pending_.empty();
  if (committing_) {
    pending_.front()->leads = true;
    pending_.front()->changed.NotifyOne();
  }
  return mine.status;
}

void SqlJobStore::CommitGroup(const std::vector<PendingPart*>& parts) {
  absl::Status shared = parts_->Sync();
  if (shared.ok()) shared = CommitRows(parts);
  if (shared.ok()) return;
  for (PendingPart* pending : parts) pending->status = shared;
}

absl::Status SqlJobStore::CommitRows(const std::vector<PendingPart*>& parts) {
  const MutexLock lock(&database_mutex_);
  return InTransaction([&]() ABSL_EXCLUSIVE_LOCKS_REQUIRED(database_mutex_) {
    std::span<PendingPart* const> left(parts);
    while (!left.empty()) {
      const auto together = left.first(StatementRows(left.size()));
      left = left.subspan(together.size());
      if (together.size() == 1) {
        PendingPart* const pending = together.front();
        pending->status = InsertRow(*pending->row);
        // A key that exists already affects only its own row. Other errors may have ended the
        // transaction, and later rows would then be inserted outside it.
        if (!pending->status.ok() && !absl::IsAlreadyExists(pending->status)) {
          return pending->status;
        }
        continue;
      }
      std::vector<const PartRow*> rows;
      for (const PendingPart* pending : together) rows.push_back(pending->row);
      const absl::StatusOr<std::vector<bool>> is_stored = InsertTogether(rows, database_.get());
      if (!is_stored.ok()) return is_stored.status();
      for (size_t i = 0; i < together.size(); ++i) {
        if (!(*is_stored)[i]) together[i]->status = KeyHasPart();
      }
    }
    return AddUsageOf(parts);
  });
}

absl::Status SqlJobStore::InsertRow(const PartRow& row) {
  // An error would end a transaction of PostgreSQL.
  Statement insert = database_->Prepare(
      absl::StrCat("INSERT ", IntoTable<Sealed<PartRow>>("parts"), " ON CONFLICT DO NOTHING"));
  if (absl::Status status = BindRow(Seal(row), &insert).Run(); !status.ok()) return status;
  return database_->ChangedRows() == 1 ? absl::OkStatus() : KeyHasPart();
}

absl::StatusOr<std::optional<PartRow>> SqlJobStore::FindPart(const PartKey& key) {
  const MutexLock lock(&database_mutex_);
  Statement query = database_->Prepare(
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

absl::StatusOr<std::vector<PartRow>> SqlJobStore::FindTileParts(const FrameId& frame,
                                                                const PixelRect& tile,
                                                                TaskKind kind) {
  const MutexLock lock(&database_mutex_);
  Statement query = database_->Prepare(
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

absl::StatusOr<std::vector<PartRow>> SqlJobStore::ListParts(uint64_t job_id) {
  const MutexLock lock(&database_mutex_);
  Statement query =
      database_->Prepare(absl::StrCat(SelectFrom<Sealed<PartRow>>("parts"), "WHERE job_id = ?"));
  query.Bind(job_id);
  return ReadPartRows(&query);
}

absl::StatusOr<std::vector<JobStore::TileCost>> SqlJobStore::TileCosts(const FrameId& frame) {
  const MutexLock lock(&database_mutex_);
  Statement query = database_->Prepare(
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

absl::StatusOr<std::string> SqlJobStore::ReadPart(const PartRow& row) {
  return parts_->Get(NameOf(row), {row.digest.sha256_hex, row.digest.size_bytes});
}

absl::Status SqlJobStore::RemovePart(const PartRow& row) {
  uint64_t bytes = 0;  // 0 if the row is already gone.
  {
    const MutexLock lock(&database_mutex_);
    Statement removal = database_->Prepare(
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
  // A remaining object has no row, and is removed with its frame or at the next start.
  const absl::Status gone = parts_->Remove(NameOf(row));
  if (!gone.ok()) LogWarning(absl::StrCat("removing a part: ", gone.message()));
  return absl::OkStatus();
}

absl::Status SqlJobStore::RemoveFrameParts(const FrameId& frame) {
  uint64_t bytes = 0;
  {
    const MutexLock lock(&database_mutex_);
    Statement sum = database_->Prepare(
        "SELECT CAST(COALESCE(SUM(size_bytes), 0) AS BIGINT) FROM parts "
        "WHERE job_id = ? AND frame_number = ?");
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
  const absl::Status gone = parts_->RemoveFolder(FolderOf(frame));
  if (!gone.ok()) {
    LogWarning(
        absl::StrCat("removing parts; some are left until the next start: ", gone.message()));
  }
  return absl::OkStatus();
}

absl::StatusOr<std::optional<FrameId>> SqlJobStore::OldestDeliveredWithParts() {
  const MutexLock lock(&database_mutex_);
  Statement query = database_->Prepare(
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
